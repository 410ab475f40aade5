"""Patients fitted where they lie, and where their fit lays them; what is no such shape is told."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
import trimesh
from eggs import egg, saved, turned
from numpy.typing import NDArray

from naisr_model import cli
from naisr_model.atlas import Atlas
from naisr_model.errors import Cancelled
from naisr_model.patients.fitting import fitted_in_place
from naisr_model.patients.intake import Intake, read
from naisr_model.progress import Progress

KNOWN = {"age": 6.0, "sex": 1.0}
SMALL = turned(4.0, [1.5, -2.0, 4.0])
"""What closest points may leave of a wrong place."""


@pytest.fixture(scope="module")
def atlas(egg_atlas) -> Atlas:
    return Atlas.load(egg_atlas)


def misplaced(atlas: Atlas, folder: Path, motion: NDArray[np.float64]) -> Intake:
    """An egg as closest points may have laid it: away from its own place by a motion that is known."""
    return dataclasses.replace(read(saved(egg(6.0, 1.0), folder / "egg.stl", motion), atlas), method="icp")


def off_mm(intake: Intake, motion: NDArray[np.float64] = SMALL) -> float:
    """How far the points of an egg that was moved by ``motion`` lie from where they belong."""
    home = egg(6.0, 1.0)
    lies = home.copy().apply_transform(intake.patient.from_file @ motion)
    return float(np.linalg.norm(lies.vertices - home.vertices, axis=1).mean())


@pytest.mark.parametrize("known", [{}, KNOWN], ids=["nothing known", "all known"])
def test_a_patient_is_laid_onto_its_own_fit(atlas, tmp_path, known):
    lay = misplaced(atlas, tmp_path, SMALL)
    once = atlas.fit(lay.patient.mesh_mm, known)
    fit, lies = fitted_in_place(lay, atlas, known)
    assert fit.residual_mm < 0.25 * once.residual_mm and fit.is_valid
    assert off_mm(lies) < 0.1 * off_mm(lay)
    assert fit.covariates["age"] == pytest.approx(6.0, abs=0.3)
    assert lies.relaid_mm == pytest.approx(off_mm(lay), rel=0.1)
    assert off_mm(lay) > 4, "the patient that was given stays as it was"


def test_one_that_lies_in_place_or_was_not_moved_stays(atlas, tmp_path):
    lay = dataclasses.replace(misplaced(atlas, tmp_path, SMALL), method="none")
    assert fitted_in_place(lay, atlas, KNOWN)[1] is lay
    home = misplaced(atlas, tmp_path, np.eye(4))
    assert off_mm(fitted_in_place(home, atlas, KNOWN)[1], np.eye(4)) < 0.3


def test_laying_it_again_tells_how_far_it_is_and_can_be_stopped(atlas, tmp_path):
    lay = misplaced(atlas, tmp_path, SMALL)
    told: list[float] = [0.0]
    fitted_in_place(lay, atlas, KNOWN, progress=Progress(told.append))
    assert told == sorted(told) and told[-1] == 1.0
    with pytest.raises(Cancelled):
        fitted_in_place(lay, atlas, KNOWN, progress=Progress(told.append, lambda: told[-1] > 0.3))


def box(extents_mm: tuple[float, float, float]) -> trimesh.Trimesh:
    return trimesh.creation.box(extents_mm).subdivide_to_size(4.0)


@pytest.mark.parametrize(
    "shape",
    [trimesh.creation.icosphere(3, 30.0), trimesh.creation.icosphere(3, 14.0), box((44, 40, 64))],
    ids=["large sphere", "small sphere", "box"],
)
def test_what_is_no_such_shape_has_no_valid_fit(atlas, egg_atlas, tmp_path, capsys, shape):
    fit = atlas.fit(shape, {"age": 6.0})
    assert not fit.is_valid
    (remark,) = fit.remarks
    assert remark.startswith("not valid") and f"{fit.residual_mm:.1f} mm" in remark
    path = saved(shape, tmp_path / "other.stl")
    for words in (["transfer", "--to", "age=8"], ["evolve", "--along", "age"]):
        given = [words[0], str(path), *words[1:], "--atlas", str(egg_atlas), "--known", "age=6"]
        assert cli.main([*given, "--out", str(tmp_path / "out")]) == 2
        assert remark in capsys.readouterr().err and not (tmp_path / "out").exists()


@pytest.mark.parametrize("age", [1.5, 6.0, 8.5])
def test_eggs_in_place_are_valid_and_not_astray(atlas, tmp_path, age):
    intake = read(saved(egg(age, -1.0), tmp_path / "egg.stl"), atlas)
    assert intake.found == () and atlas.fit(intake.patient.mesh_mm).is_valid


@pytest.mark.parametrize("motion", [turned(0, [0, 0, 12]), turned(60, [0, 0, 0])], ids=["shifted", "turned"])
def test_one_astray_is_told_of_before_it_is_fitted(atlas, tmp_path, motion):
    intake = read(saved(egg(8.0, -1.0), tmp_path / "egg.stl", motion), atlas)
    (remark,) = [each for each in intake.found if each.topic == "astray"]
    assert remark.severity == "look" and intake.is_ready
    assert "align it to the atlas" in remark.remedy
    assert not atlas.fit(intake.patient.mesh_mm, {"age": 8.0}).is_valid


def lower(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    kept = mesh.faces[mesh.triangles_center[:, 2] < 4.0]
    return trimesh.Trimesh(mesh.vertices, kept)


@pytest.mark.parametrize("part", [lambda mesh: mesh, lower], ids=["whole", "part"])
@pytest.mark.parametrize(("age", "known"), [(2.0, {}), (6.0, KNOWN), (8.5, {"sex": 1.0})])
def test_a_fit_tells_of_a_scan_that_lies_off_and_of_no_other(atlas, tmp_path, part, age, known):
    for distance_mm in (0.0, 1.2):
        motion = turned(0, [0.0, 0.6 * distance_mm, 0.8 * distance_mm])
        lay = read(saved(part(egg(age, 1.0)), tmp_path / "egg.stl", motion), atlas)
        fit, lies = fitted_in_place(lay, atlas, known)
        told = [remark for remark in fit.remarks if "seems to lie" in remark]
        assert lies is lay and fit.is_valid
        if distance_mm:
            assert fit.astray_mm == pytest.approx(distance_mm, rel=0.3)
            assert told == [f"the scan seems to lie {fit.astray_mm:.1f} mm off; align it to the atlas"]
        else:
            assert fit.astray_mm is None and not told
