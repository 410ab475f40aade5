"""Maps of what covariates do to a surface, against sums of parts, finite differences and a closed form."""

from __future__ import annotations

from pathlib import Path
from typing import cast

import numpy as np
import pytest
import torch

from naisr_model.atlas import Atlas
from naisr_model.errors import InputError
from naisr_model.models.base import ShapeModel
from naisr_model.surface.maps import rates

VALUES = {"age": 6.0, "sex": 0.4}


@pytest.fixture(scope="module")
def atlas(egg_atlas: Path) -> Atlas:
    return Atlas.load(egg_atlas)


@pytest.fixture(scope="module")
def code(atlas: Atlas) -> np.ndarray:
    return 5 * np.asarray(atlas.checkpoint.latents[0])


@pytest.fixture(scope="module")
def surface(atlas: Atlas, code: np.ndarray):
    """Points of the shape, and where they are on the template."""
    points_mm = np.asarray(atlas.shape(VALUES, code, 64).vertices)[::40]
    return points_mm, atlas.origins_mm(points_mm, VALUES, code)


def test_what_was_moved_is_the_sum_of_the_parts(atlas, code, surface):
    points_mm, origins_mm = surface
    found = atlas.contributions(origins_mm, VALUES, code, points_mm)
    total = (found.effects_mm.sum(axis=0) + found.person_mm) * found.normals
    np.testing.assert_allclose(atlas.moved_mm(points_mm, VALUES, code), total.sum(axis=1), atol=1e-3)
    assert np.ptp(total.sum(axis=1)) > 0.5


@pytest.mark.parametrize("name", ["age", "sex"])
def test_a_rate_is_the_way_of_the_material_points_a_little_later(atlas, code, surface, name):
    points_mm, origins_mm = surface
    step = 0.05
    either = [{**VALUES, name: VALUES[name] + side * step} for side in (-1, 1)]
    before, after = atlas.carried_mm(origins_mm, either, [code, code])
    normals = atlas.contributions(origins_mm, VALUES, code, points_mm).normals
    speed = np.sum((after - before) * normals, axis=1) / (2 * step)
    np.testing.assert_allclose(
        atlas.rates_mm(points_mm, name, VALUES, code), speed, atol=0.02 * np.abs(speed).max()
    )
    assert np.abs(speed).max() > 0.1


def test_the_contrast_of_two_levels_is_the_way_between_them(atlas, code, surface):
    points_mm, origins_mm = surface
    low, high = (
        atlas.contributions(origins_mm, {**VALUES, "sex": level}, code, points_mm).points_mm
        for level in (-1.0, 1.0)
    )
    normals = atlas.contributions(origins_mm, VALUES, code, points_mm).normals
    np.testing.assert_allclose(
        atlas.contrast_mm(points_mm, "sex", VALUES, code),
        np.sum((high - low) * normals, axis=1),
        atol=0.02,
    )


class Ball(torch.nn.Module):
    """A ball whose radius is 1 + c_0 / 2, and a field three times as steep as a distance."""

    def forward(self, points, covariates, latents):
        return 3 * (points.norm(dim=-1) - 1 - 0.5 * covariates[:, :1])


def test_a_ball_grows_everywhere_alike_however_steep_its_field_is():
    points = torch.nn.functional.normalize(torch.randn(20, 3, generator=torch.manual_seed(0)), dim=1)
    covariates = torch.tensor([0.2, 0.7])
    ball = cast(ShapeModel, Ball())
    found = [rates(ball, 1.1 * points, covariates, torch.zeros(1), index) for index in (0, 1)]
    torch.testing.assert_close(found[0], torch.full((20,), 0.5))
    torch.testing.assert_close(found[1], torch.zeros(20))


def test_what_there_is_no_map_of_is_refused(atlas, surface):
    points_mm, _ = surface
    with pytest.raises(InputError, match="height"):
        atlas.rates_mm(points_mm, "height", VALUES)
    with pytest.raises(InputError, match="height"):
        atlas.contrast_mm(points_mm, "height", VALUES)
