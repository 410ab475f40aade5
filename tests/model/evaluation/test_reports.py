"""The record of an evaluation and the tables made of it."""

from __future__ import annotations

import dataclasses
import json

import pytest
from rich.console import Console
from rich.markdown import Markdown

from naisr_model.errors import InputError
from naisr_model.evaluation.metrics import Distances
from naisr_model.evaluation.reports import (
    COLUMNS,
    DEFINITIONS,
    PUBLISHED_AIRWAY,
    TruthPoint,
    reconstruction_markdown,
    reconstruction_report,
)

FIRST = Distances(0.01, 2.0, 1.0, 3.0, 0.5, 0.1, samples=30_000, emd_samples=2048)
OTHERS = [dataclasses.replace(FIRST, cd_x100=cd, hd_x100=hd) for cd, hd in [(0.02, 3.0), (0.06, 10.0)]]
GROWTH = (
    TruthPoint("age", 6, "girls", volume_cm3=2.1, truth_cm3=2.0, hd_x100=1.5),
    TruthPoint("age", 6, "boys", volume_cm3=1.8, truth_cm3=2.0, hd_x100=1.6),
    TruthPoint("age", 220, "boys", volume_cm3=62.0, truth_cm3=60.0, hd_x100=2.5),
)
EFFECTS = (
    TruthPoint("age", 60, "", volume_cm3=33.0, truth_cm3=30.0, hd_x100=2.0),
    TruthPoint("age", 117, "", volume_cm3=39.0, truth_cm3=40.0, hd_x100=2.0),
    TruthPoint("weight", 40, "", volume_cm3=38.0, truth_cm3=40.0, hd_x100=2.0),
)


def report(**changes: object) -> dict:
    given = {"components": [1, 1, 2], "folded_share": 0.0025, "growth": GROWTH, "effects": EFFECTS}
    return reconstruction_report([FIRST, *OTHERS], **{**given, **changes})  # type: ignore[arg-type]


def test_mean_and_median_of_every_distance() -> None:
    found = report()
    assert found["n"] == 3
    assert found["cd_x100"] == pytest.approx({"mean": 0.03, "median": 0.02})
    assert found["hd_x100"] == pytest.approx({"mean": 5.0, "median": 3.0})
    assert found["vd_cm3"] == pytest.approx({"mean": 0.1, "median": 0.1})


def test_fits_with_nothing_known_stand_beside_the_others() -> None:
    found = report(inferred=OTHERS)
    assert found["inferred"]["n"] == 2
    assert found["inferred"]["cd_x100"] == pytest.approx({"mean": 0.04, "median": 0.04})
    text = reconstruction_markdown(found)
    assert "3 held-out shapes, covariates given | 0.03 / 0.02" in text
    assert "2 held-out shapes, covariates inferred | 0.04 / 0.04" in text
    assert "inferred" not in reconstruction_markdown(report())


def test_the_worst_volume_error_is_kept_with_its_sign() -> None:
    found = report()
    assert found["truth_volume_error"] == pytest.approx({"6": -0.1, "220": 2 / 60})
    assert found["effect_volume_error"] == pytest.approx({"age": 0.1, "weight": -0.05})


def test_components_and_folds() -> None:
    found = report()
    assert found["components"] == [1, 2]
    assert found["folded_share"] == 0.0025


def test_the_record_survives_json_and_defines_what_it_shows() -> None:
    found = report()
    assert json.loads(json.dumps(found)) == found
    assert set(found["definitions"]) == set(COLUMNS) == set(DEFINITIONS)


def test_every_distance_is_a_field_of_the_measurement() -> None:
    fields = {field.name for field in dataclasses.fields(Distances)}
    assert set(COLUMNS) == fields - {"samples", "emd_samples"}


def test_an_atlas_without_a_known_truth_has_no_truth_tables() -> None:
    found = report(growth=(), effects=())
    assert found["truth_volume_error"] == {}
    assert "growth path" not in reconstruction_markdown(found)


def test_nothing_held_out_is_said_in_words() -> None:
    with pytest.raises(InputError, match="held out"):
        reconstruction_report([], components=[], folded_share=0.0)


def test_the_table_shows_values_units_definitions_and_the_published_rows() -> None:
    text = reconstruction_markdown(report(), PUBLISHED_AIRWAY)
    assert "0.03 / 0.02" in text
    assert "VD, cm³" in text
    assert "mean squared nearest-neighbour" in text
    assert "30,000 surface samples" in text
    assert "2,048 for EMD" in text
    published = [line for line in text.splitlines() if line.startswith("| published")]
    assert len(published) == 2
    assert "0.084 / 0.044" in published[0]
    assert "-10.0%" in text


def test_rows_have_as_many_cells_as_their_header() -> None:
    text = reconstruction_markdown(report(), PUBLISHED_AIRWAY)
    for block in text.split("\n\n"):
        rows = [line for line in block.splitlines() if line.startswith("|")]
        assert len({row.count("|") for row in rows}) <= 1


def test_a_terminal_shows_the_same_table() -> None:
    console = Console(width=160)
    with console.capture() as shown:
        console.print(Markdown(reconstruction_markdown(report(), PUBLISHED_AIRWAY)))
    assert "0.03 / 0.02" in shown.get()
