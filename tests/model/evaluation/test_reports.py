"""What the reports of several studies have in common."""

from __future__ import annotations

import dataclasses

import pytest

from naisr_model.evaluation.metrics import Distances
from naisr_model.evaluation.published import RECONSTRUCTION
from naisr_model.evaluation.reports import (
    COLUMNS,
    DEFINITIONS,
    definitions,
    distance_cells,
    markdown_table,
    meaning,
    published_cells,
    summary,
)

FIRST = Distances(0.01, 2.0, 1.0, 3.0, 0.5, 0.1, samples=30_000, emd_samples=2048)
OTHERS = [dataclasses.replace(FIRST, cd_x100=cd, hd_x100=hd) for cd, hd in [(0.02, 3.0), (0.06, 10.0)]]


def test_mean_and_median_of_every_distance() -> None:
    found = summary([FIRST, *OTHERS])
    assert found["n"] == 3
    assert found["cd_x100"] == pytest.approx({"mean": 0.03, "median": 0.02})
    assert found["hd_x100"] == pytest.approx({"mean": 5.0, "median": 3.0})
    assert found["vd_cm3"] == pytest.approx({"mean": 0.1, "median": 0.1})
    assert distance_cells(found)[:2] == ["0.03 / 0.02", "5 / 3"]


def test_every_distance_is_a_field_of_the_measurement() -> None:
    fields = {field.name for field in dataclasses.fields(Distances)}
    assert set(COLUMNS) == set(DEFINITIONS) == fields - {"samples", "emd_samples"}


def test_columns_are_defined_below_the_table() -> None:
    text = definitions(meaning(FIRST), "somewhere")
    assert "mean squared nearest-neighbour" in text and "30,000 surface samples" in text
    assert "2,048 for EMD" in text and "- published: somewhere." in text
    assert "published" not in definitions(meaning(FIRST))


def test_published_rows_keep_their_digits() -> None:
    cells = published_cells(RECONSTRUCTION["airway"][0])
    assert cells[0] == "0.084 / 0.044" and len(cells) == len(COLUMNS) and "–" in cells


def test_a_table_is_markdown() -> None:
    text = markdown_table(["", "a"], [["one", "1"], ["two", "2"]])
    assert text.splitlines() == ["|  | a |", "| --- | ---: |", "| one | 1 |", "| two | 2 |"]
