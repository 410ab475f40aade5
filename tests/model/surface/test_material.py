"""Material points and what moves them, against closed forms, the sum and finite differences."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh

from naisr_model.atlas import Atlas
from naisr_model.errors import InputError
from naisr_model.models.base import deformable
from naisr_model.surface import material


@pytest.fixture(scope="module")
def atlas(egg_atlas: Path) -> Atlas:
    return Atlas.load(egg_atlas)


@pytest.fixture(scope="module")
def template(atlas: Atlas) -> trimesh.Trimesh:
    return atlas.template(64)


@pytest.fixture
def code(atlas: Atlas) -> np.ndarray:
    return 5 * np.asarray(atlas.checkpoint.latents[0])


VALUES = {"age": 8.0, "sex": -1.0}


def test_a_point_is_found_again(atlas, template, code):
    points_mm = atlas.contributions(template.vertices[:40], VALUES, code).points_mm
    np.testing.assert_allclose(atlas.origins_mm(points_mm, VALUES, code), template.vertices[:40], atol=1e-3)
    assert (
        np.abs(atlas.sdf(points_mm, VALUES, code)).max() < 0.05
    )  # the template's chords are not its surface


def test_the_parts_add_up_to_the_way_that_was_gone(atlas, template, code):
    found = atlas.contributions(template.vertices[:40], VALUES, code)
    total = found.effects_mm.sum(axis=0) + found.person_mm
    np.testing.assert_allclose(total, found.points_mm - found.origins_mm, atol=1e-3)
    assert np.abs(found.person_mm).max() > 0.1


def test_nobody_in_particular_has_no_part_of_their_own(atlas, template):
    assert np.abs(atlas.contributions(template.vertices[:5], VALUES).person_mm).max() == 0


def test_what_is_at_its_centre_moves_nothing(atlas, template):
    found = atlas.contributions(template.vertices[:5], {"age": 8.0})
    assert np.abs(found.effects_mm[1]).max() < 1e-4
    assert np.abs(found.effects_mm[0]).max() > 0.5


def test_age_lengthens_an_egg_and_sex_widens_it(atlas, template):
    """The population's closed form: half axes of 20 + 2 sex, 20 and 20 + 2 age mm."""
    tip, side = template.vertices[:, 2].argmax(), template.vertices[:, 0].argmax()
    centre = atlas.covariates[0].centre
    young, old = (
        atlas.contributions(template.vertices[[tip, side]], {"age": age, "sex": 1.0})
        for age in (centre - 2, centre + 2)
    )
    grown_mm = old.effects_mm[0] - young.effects_mm[0]
    assert grown_mm[0] @ old.normals[0] == pytest.approx(8, abs=1)
    assert abs(grown_mm[1] @ old.normals[1]) < 1
    assert old.effects_mm[1, 1] @ old.normals[1] == pytest.approx(2, abs=0.7)


def test_normals_are_unit_gradients_of_the_distance(atlas, template):
    found, step_mm = atlas.contributions(template.vertices[:10], VALUES), 0.05
    for axis, shift in enumerate(step_mm * np.eye(3)):
        ahead, behind = (atlas.sdf(found.points_mm + sign * shift, VALUES) for sign in (1, -1))
        np.testing.assert_allclose((ahead - behind) / (2 * step_mm), found.normals[:, axis], atol=0.05)


def test_a_guess_changes_nothing(atlas, template):
    plain = atlas.contributions(template.vertices[:5], VALUES)
    guessed = atlas.contributions(template.vertices[:5], VALUES, start_mm=plain.points_mm + 0.3)
    np.testing.assert_allclose(guessed.points_mm, plain.points_mm, atol=2e-3)


def test_where_nothing_is_found_it_is_said(atlas, template, monkeypatch):
    monkeypatch.setattr(material, "STEPS", 1)
    with pytest.raises(InputError, match="folds"):
        atlas.contributions(template.vertices[:5], VALUES)


def test_a_model_without_parts_says_so(egg_deepsdf):
    with pytest.raises(InputError, match="DeepSDF"):
        Atlas.load(egg_deepsdf).contributions(np.zeros((1, 3)), {})


def test_places_are_exact_in_double_precision(atlas, template):
    model = deformable(atlas.checkpoint.model()).double()
    targets = torch.as_tensor(atlas.frame.to_model(template.vertices[:5]))
    vector, latent = torch.tensor([1.2, -1.0]).double(), torch.zeros(4).double()
    found = material.places(model, targets, vector, latent)
    torch.testing.assert_close(material.origins(model, found, vector, latent), targets, atol=1e-5, rtol=0)
