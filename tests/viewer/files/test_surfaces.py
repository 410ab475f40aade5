"""Files written by the viewer, read back by another program's reader."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
import trimesh

from naisr_model import __version__
from naisr_model.errors import InputError
from naisr_model.exports import FORMATS
from naisr_viewer.files import surfaces as export
from naisr_viewer.state.layouts import FULL_SHAPE, Panel
from naisr_viewer.state.requests import SurfaceRequest, SurfaceResult

VALUES = {"age": 150.0, "weight": 50.0, "sex": 1.0}


@pytest.fixture
def result(engine, card) -> SurfaceResult:
    return engine.surface(SurfaceRequest(card.path, FULL_SHAPE, tuple(VALUES.items()), 128))


def read(path: Path) -> trimesh.Trimesh:
    if path.suffix == ".vtp":
        mesh = pv.read(path)
        return trimesh.Trimesh(mesh.points, mesh.regular_faces)
    mesh = trimesh.load_mesh(path)
    if path.suffix == ".glb":  # metres, y up
        mesh.apply_transform([[1000, 0, 0, 0], [0, 0, -1000, 0], [0, 1000, 0, 0], [0, 0, 0, 1]])
    mesh.merge_vertices()  # STL has no shared vertices
    return mesh


@pytest.mark.parametrize("ending", FORMATS)
def test_every_format_holds_the_true_shape_in_its_unit(result, card, atlas, tmp_path, ending):
    path, _ = export.write_surface(tmp_path / f"shape.{ending}", result, card)
    mesh = read(path)
    assert mesh.volume / 1000 == pytest.approx(atlas.volume_cm3(**VALUES), rel=0.01)
    assert mesh.volume == pytest.approx(trimesh.Trimesh(result.points_mm, result.faces).volume, rel=1e-4)
    assert mesh.is_watertight
    record = json.loads(export.record_of(path).read_text(encoding="utf-8"))
    assert (record["length_unit"], record["up"]) == (("m", "y") if ending == "glb" else ("mm", "z"))
    np.testing.assert_allclose(mesh.extents / 2, atlas.half_axes_mm(**VALUES), rtol=0.01)


def test_the_record_says_what_the_file_shows(result, card, tmp_path):
    _, beside = export.write_surface(tmp_path / "shape.stl", result, card)
    record = json.loads(beside.read_text(encoding="utf-8"))
    assert beside.name == "shape.stl.json"
    own_cm3 = trimesh.load_mesh(tmp_path / "shape.stl").volume / 1000
    assert record["volume_of_triangles_cm3"] == pytest.approx(own_cm3, rel=1e-4)
    assert own_cm3 < record["volume_cm3"]
    assert record["atlas"] == "ellipsoid"
    assert record["view"] == "Full shape"
    assert record["covariates"]["age"] == {"value": 150.0, "unit": "months"}
    assert record["covariates"]["sex"]["reading"] == "M"
    assert record["volume_cm3"] == pytest.approx(result.volume_cm3, abs=1e-3)
    assert record["length_unit"] == "mm"
    assert record["program"] == f"naisr-viewer {__version__}"


def test_an_effect_records_the_others_at_their_mean(engine, card):
    effect = engine.surface(SurfaceRequest(card.path, Panel("effect", "age"), (("age", 20.0),), 64))
    record = export.description(effect, card, "x.stl")
    assert record["depends_on"] == ["age"]
    assert record["covariates"]["weight"]["value"] == 35.0


def test_a_failed_write_leaves_the_old_file_and_no_rubbish(tmp_path):
    path = tmp_path / "shape.stl"
    path.write_text("the old one")

    def fail(place: Path) -> None:
        place.write_text("half of the new")
        raise OSError(28, "No space left on device")

    with pytest.raises(InputError, match="No space left"):
        export.write_atomically(path, fail)
    assert path.read_text() == "the old one"
    assert os.listdir(tmp_path) == ["shape.stl"]


def test_nothing_and_nonsense_are_refused_in_words(result, card, atlas, engine, tmp_path, monkeypatch):
    with pytest.raises(InputError, match="must be one of stl, ply"):
        export.write_surface(tmp_path / "shape.docx", result, card)
    monkeypatch.setattr(atlas, "_surface", lambda *_: trimesh.Trimesh())
    empty = engine.surface(SurfaceRequest(card.path, FULL_SHAPE, (), 64))
    with pytest.raises(InputError, match="no surface"):
        export.write_surface(tmp_path / "shape.stl", empty, card)
    assert os.listdir(tmp_path) == ["ellipsoid.safetensors"]
