"""Files written by the viewer, read back by another program's reader."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
import trimesh

from naisr_model import __version__
from naisr_model.errors import InputError
from naisr_model.exports import FORMATS
from naisr_model.files import write_all
from naisr_viewer.files import surfaces as export
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.layouts import FULL_SHAPE, Panel
from naisr_viewer.state.overlay import Map, Quantity
from naisr_viewer.state.requests import Colouring, Origin, SurfaceRequest, SurfaceResult

VALUES = {"age": 150.0, "weight": 50.0, "sex": 1.0}


@pytest.fixture
def result(engine, card) -> SurfaceResult:
    return engine.surface(SurfaceRequest(card.path, FULL_SHAPE, tuple(VALUES.items()), 128))


def written(path: Path, result: SurfaceResult, card: AtlasCard) -> tuple[Path, Path]:
    write_all(export.surface_files(path, result, card))
    return path, export.record_of(path)


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
    path, _ = written(tmp_path / f"shape.{ending}", result, card)
    mesh = read(path)
    assert mesh.volume / 1000 == pytest.approx(atlas.volume_cm3(**VALUES), rel=0.01)
    assert mesh.volume == pytest.approx(trimesh.Trimesh(result.points_mm, result.faces).volume, rel=1e-4)
    assert mesh.is_watertight
    record = json.loads(export.record_of(path).read_text(encoding="utf-8"))
    assert (record["length_unit"], record["up"]) == (("m", "y") if ending == "glb" else ("mm", "z"))
    np.testing.assert_allclose(mesh.extents / 2, atlas.half_axes_mm(**VALUES), rtol=0.01)


def test_the_record_says_what_the_file_shows(result, card, tmp_path):
    _, beside = written(tmp_path / "shape.stl", result, card)
    record = json.loads(beside.read_text(encoding="utf-8"))
    assert beside.name == "shape.stl.json"
    own_cm3 = trimesh.load_mesh(tmp_path / "shape.stl").volume / 1000
    assert record["volume_of_triangles_cm3"] == pytest.approx(own_cm3, rel=1e-4)
    assert own_cm3 < record["volume_cm3"]
    assert record["atlas"] == "ellipsoid"
    assert record["view"] == "Full shape"
    assert record["covariates"]["age"] == {"value": 150.0, "unit": "months"}
    assert record["covariates"]["sex"]["reading"] == "M"
    assert record["volume_cm3"] == pytest.approx(result.extent, abs=1e-3)
    assert record["length_unit"] == "mm"
    assert record["program"] == f"naisr-viewer {__version__}"


def changes(result: SurfaceResult) -> np.ndarray:
    """A number at each vertex."""
    return np.linspace(-2, 5, len(result.points_mm), dtype=np.float32)


def coloured(result: SurfaceResult) -> SurfaceResult:
    """The same as the change since 60 months, with a number at each vertex."""
    before = (0, (("age", 60.0), ("weight", 20.0), ("sex", 1.0)))
    request = replace(result.request, panel=Panel("change"), before=before)
    return replace(result, request=request, colouring=Colouring(changes(result), 3.0, "signed"))


@pytest.mark.parametrize("ending", FORMATS)
def test_numbers_on_a_surface_are_in_the_file_or_the_record_says_that_they_are_not(
    result, card, tmp_path, ending
):
    change = coloured(result)
    path, beside = written(tmp_path / f"change.{ending}", change, card)
    numbers = json.loads(beside.read_text(encoding="utf-8"))["numbers"]
    assert (numbers["name"], numbers["unit"]) == ("change_mm", "mm")
    assert numbers["in_file"] == (ending in ("ply", "vtp"))
    if ending == "vtp":
        np.testing.assert_array_equal(pv.read(path).point_data["change_mm"], changes(result))
    if ending == "ply":
        raw = trimesh.load_mesh(path).metadata["_ply_raw"]["vertex"]["data"]
        np.testing.assert_array_equal(raw["change_mm"], changes(result))
    assert read(path).volume == pytest.approx(
        trimesh.Trimesh(result.points_mm, result.faces).volume, rel=1e-4
    )


MAPS = {
    Map(Quantity.DISPLACEMENT): ("displacement_mm", "mm"),
    Map(Quantity.RATE, "age"): ("rate_of_age_mm_per_month", "mm per month"),
    Map(Quantity.RATE, "sex"): ("contrast_of_sex_mm_M_against_F", "mm, M against F"),
}


@pytest.mark.parametrize("shown", MAPS)
def test_numbers_of_a_map_are_called_what_they_are(result, card, tmp_path, shown):
    request = replace(result.request, map=shown)
    mapped = replace(result, request=request, colouring=Colouring(changes(result), 3.0, "signed"))
    path, beside = written(tmp_path / "map.vtp", mapped, card)
    numbers = json.loads(beside.read_text(encoding="utf-8"))["numbers"]
    name, unit = MAPS[shown]
    assert (numbers["name"], numbers["unit"], numbers["in_file"]) == (name, unit, True)
    np.testing.assert_array_equal(pv.read(path).point_data[name], changes(result))


def test_a_change_records_what_it_is_counted_from(result, card):
    record = export.description(coloured(result), card, "x.ply")
    assert record["before"]["covariates"]["age"] == {"value": 60.0, "unit": "months"}
    assert record["before"]["patient"] is None
    assert export.description(result, card, "x.ply")["before"] is None


@pytest.mark.parametrize("ending", FORMATS)
def test_a_cloud_of_points_goes_where_points_can_be(result, card, tmp_path, ending):
    cloud = replace(coloured(result), faces=np.zeros((0, 3), np.int64), extent=0.0, origin=Origin.MEASURED)
    path = tmp_path / f"scan.{ending}"
    if ending not in ("ply", "vtp"):
        with pytest.raises(InputError, match="export it as ply or vtp"):
            written(path, cloud, card)
        assert not path.exists()
        return
    _, beside = written(path, cloud, card)
    np.testing.assert_allclose(pv.read(path).points, result.points_mm, rtol=1e-5)
    record = json.loads(beside.read_text(encoding="utf-8"))
    assert record["volume_cm3"] is None and record["volume_of_triangles_cm3"] is None


def test_an_effect_records_the_others_at_their_mean(engine, card):
    effect = engine.surface(SurfaceRequest(card.path, Panel("effect", "age"), (("age", 20.0),), 64))
    record = export.description(effect, card, "x.stl")
    assert record["depends_on"] == ["age"]
    assert record["covariates"]["weight"]["value"] == 35.0


@pytest.mark.parametrize("ending", FORMATS)
def test_a_surface_that_finds_no_room_is_a_sentence_and_leaves_nothing(
    result, card, tmp_path, ending, no_room
):
    out = tmp_path / "out"
    sentence = rf"cannot write .*shape\.{ending}: File too large; "
    with no_room(2_000), pytest.raises(InputError, match=sentence):
        written(out / f"shape.{ending}", result, card)
    assert not out.exists()


def test_nothing_and_nonsense_are_refused_in_words(result, card, atlas, engine, tmp_path, monkeypatch):
    with pytest.raises(InputError, match="must be one of stl, ply"):
        written(tmp_path / "shape.docx", result, card)
    monkeypatch.setattr(atlas, "_surface", lambda *_: trimesh.Trimesh())
    empty = engine.surface(SurfaceRequest(card.path, FULL_SHAPE, (), 64))
    with pytest.raises(InputError, match="no surface"):
        written(tmp_path / "shape.stl", empty, card)
    assert os.listdir(tmp_path) == ["ellipsoid.safetensors"]
