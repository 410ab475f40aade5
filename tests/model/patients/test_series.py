"""The files of a series of shapes."""

from __future__ import annotations

import csv

import pytest
import trimesh
from eggs import egg

from naisr_model.atlas import Atlas
from naisr_model.errors import Cancelled
from naisr_model.patients.series import write_series
from naisr_model.progress import Progress


def test_a_series_is_meshes_a_table_and_a_picture(egg_atlas, tmp_path):
    person = Atlas.load(egg_atlas).fit(egg(6.5, 1.0), {"age": 6.5, "sex": 1.0}).individual
    (record,) = write_series(tmp_path, [person])
    assert {path.name for path in tmp_path.iterdir()} == {"shape01.stl", "volumes.csv", "shapes.png"}
    low, middle, high = (float(record[f"volume_{end}cm3"]) for end in ("low_", "", "high_"))
    assert low < middle < high
    assert trimesh.load_mesh(tmp_path / "shape01.stl").volume / 1000 == pytest.approx(middle, rel=0.02)
    with (tmp_path / "volumes.csv").open() as file:
        (row,) = csv.DictReader(file)
    assert float(row["volume_cm3"]) == pytest.approx(middle, abs=1e-4) and float(row["age"]) == 6.5
    assert write_series(None, [person]) == [record]
    with pytest.raises(Cancelled):
        write_series(None, [person], progress=Progress(is_unwanted=lambda: True))
