"""What the reports of several studies have in common."""

from __future__ import annotations

import subprocess
import sys

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


def distances(cd_x100: float, hd_x100: float) -> Distances:
    others = {"hd95_x100": 1.0, "emd_x100": 3.0, "mean_mm": 0.5, "vd_cm3": 0.1}
    return Distances({"cd_x100": cd_x100, "hd_x100": hd_x100, **others}, samples=30_000, emd_samples=2048)


FIRST, *OTHERS = (distances(cd, hd) for cd, hd in [(0.01, 2.0), (0.02, 3.0), (0.06, 10.0)])


def test_mean_and_median_of_every_distance() -> None:
    found = summary([FIRST, *OTHERS])
    assert found["n"] == 3
    assert found["cd_x100"] == pytest.approx({"mean": 0.03, "median": 0.02})
    assert found["hd_x100"] == pytest.approx({"mean": 5.0, "median": 3.0})
    assert found["vd_cm3"] == pytest.approx({"mean": 0.1, "median": 0.1})
    assert distance_cells(found)[:2] == ["0.03 / 0.02", "5 / 3"]


def test_columns_are_those_of_the_published_tables_and_our_own() -> None:
    assert COLUMNS == {
        "cd_x100": "CD x10²",
        "hd_x100": "HD x10²",
        "hd95_x100": "HD95 x10²",
        "emd_x100": "EMD x10²",
        "mean_mm": "mean distance, mm",
        "vd_cm3": "VD, cm³",
    }
    assert list(DEFINITIONS) == list(COLUMNS) and all(DEFINITIONS.values())


def test_a_metric_is_one_value_from_its_measurement_to_its_column() -> None:
    """In a program of its own, where the registry has one more."""
    program = """
from naisr_model.evaluation import metrics
area = metrics.Metric("area_cm2", "area", "cm²", "difference of the areas",
                      lambda pair: abs(pair.shape.area - pair.target.area) / 100)
metrics.METRICS += (area,)
import trimesh
from naisr_model.evaluation.reports import COLUMNS, definitions, distance_cells
from naisr_model.evaluation.reports import markdown_table, meaning, summary
box, cube = (trimesh.creation.box(extents=(10, 10, side)) for side in (20, 10))
found = metrics.compare(box, cube, samples=50, emd_samples=10)
print(markdown_table(COLUMNS.values(), [distance_cells(summary([found]))]), definitions(meaning(found)))
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert "VD, cm³ | area, cm² |" in done.stdout and "| 4 / 4 |" in done.stdout
    assert "- area, cm²: difference of the areas." in done.stdout


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
