"""The files of a series of shapes."""

from __future__ import annotations

import csv
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import trimesh
from eggs import egg

from naisr_model.atlas import Atlas
from naisr_model.errors import Cancelled, InputError
from naisr_model.patients.series import require_own, series_records, write_series
from naisr_model.progress import Progress


def test_a_series_is_meshes_a_table_and_a_picture(egg_atlas, tmp_path):
    person = Atlas.load(egg_atlas).fit(egg(6.5, 1.0), {"age": 6.5, "sex": 1.0}).individual
    records = series_records([person])
    write_series(tmp_path, [person], records)
    (record,) = records
    assert {path.name for path in tmp_path.iterdir()} == {"shape01.stl", "volumes.csv", "shapes.png"}
    low, middle, high = (float(record[f"volume_{end}cm3"]) for end in ("low_", "", "high_"))
    assert low < middle < high
    assert trimesh.load_mesh(tmp_path / "shape01.stl").volume / 1000 == pytest.approx(middle, rel=0.02)
    with (tmp_path / "volumes.csv").open() as file:
        (row,) = csv.DictReader(file)
    assert float(row["volume_cm3"]) == pytest.approx(middle, abs=1e-4) and float(row["age"]) == 6.5
    with pytest.raises(Cancelled):
        series_records([person], Progress(is_unwanted=lambda: True))


@pytest.fixture
def person() -> Any:
    """Somebody whose shape is an egg; no atlas is needed to write it."""
    return SimpleNamespace(
        surface=egg(5.0, 1.0),
        covariates={"age": 5.0},
        volume_cm3=1.0,
        volume_interval_cm3=(0.9, 1.1),
        atlas=SimpleNamespace(covariates=()),
    )


def write(out: Path, people: list, scan: Path | None) -> None:
    write_series(out, people, series_records(people), scan)


def names(folder) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_a_shorter_series_of_the_same_patient_takes_the_place_of_a_longer_one(person, tmp_path):
    out, scan = tmp_path / "out", tmp_path / "p01.stl"
    write(out, [person] * 3, scan)
    assert names(out) == {"shape01.stl", "shape02.stl", "shape03.stl", "volumes.csv", "shapes.png"}
    (out / "notes.txt").write_text("the user's own")
    write(out, [person], scan)
    assert names(out) == {"shape01.stl", "volumes.csv", "shapes.png", "notes.txt"}


def test_files_of_another_patient_are_left_alone(person, tmp_path):
    out = tmp_path / "out"
    write(out, [person], tmp_path / "p01.stl")
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    for other in (tmp_path / "p02.stl", tmp_path / "else" / "p01.stl", None):
        with pytest.raises(InputError, match=r"out holds shape01\.stl of .*p01\.stl; give another folder"):
            write(out, [person, person], other)
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before


@pytest.mark.parametrize("name", ["volumes.csv", "shapes.png", "shape07.stl"])
def test_files_of_something_else_are_left_alone(person, tmp_path, name):
    (tmp_path / name).write_text("room,volume\nkitchen,12\n")
    with pytest.raises(InputError, match=f"holds {name} of something else; give another folder"):
        write(tmp_path, [person], tmp_path / "p01.stl")
    assert names(tmp_path) == {name}


def test_a_series_goes_into_a_folder(tmp_path):
    (tmp_path / "file").write_text("precious")
    with pytest.raises(InputError, match="is a file; give the name of a folder"):
        require_own(tmp_path / "file", None)
    require_own(tmp_path / "new", None)
    assert names(tmp_path) == {"file"}


def test_a_series_that_finds_no_room_leaves_the_one_before(person, tmp_path, no_room):
    out, scan = tmp_path / "out", tmp_path / "p01.stl"
    write(out, [person] * 3, scan)
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    with no_room(10_000), pytest.raises(InputError, match=r"cannot write .*out.*: File too large; "):
        write(out, [person], scan)
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before
