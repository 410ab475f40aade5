"""How sure the measures of a fit are, against closed forms."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from eggs import egg

from naisr_model.atlas import Atlas
from naisr_model.measures.curves import shapes_along, template_of
from naisr_model.measures.kinds import MEASURES, VOLUME, surface_of
from naisr_model.measures.margins import margins

RADIUS = 20.0


def sure(offsets_mm, noise_mm):
    """A person whose surface may lie so."""
    return SimpleNamespace(noise_mm=noise_mm, surface_offsets_mm=lambda points: offsets_mm(points))


def test_a_ball_whose_radius_is_not_sure():
    ball = surface_of(trimesh.creation.icosphere(subdivisions=4, radius=RADIUS))
    person = sure(lambda points: np.full((1, len(points)), 0.1), 0.0)
    found = margins(person, ball, {name: MEASURES[name] for name in ("volume", "area")})
    assert found["volume"] == pytest.approx(1.96 * 0.1 * 4 * np.pi * RADIUS**2 / 1000, rel=0.01)
    assert found["area"] == pytest.approx(1.96 * 0.1 * 8 * np.pi * RADIUS / 100, rel=0.01)


def test_what_the_atlas_cannot_express_is_alike_over_patches():
    ball = surface_of(trimesh.creation.icosphere(subdivisions=4, radius=RADIUS))
    person = sure(lambda points: np.zeros((1, len(points))), 0.3)
    found = margins(person, ball, {"volume": VOLUME})
    assert found["volume"] == pytest.approx(1.96 * 0.3 * 4 * np.pi * RADIUS**2 / np.sqrt(20) / 1000, rel=0.05)


def test_the_volume_of_a_fit_is_as_sure_as_its_surface_says(egg_atlas):
    atlas, values = Atlas.load(egg_atlas), {"age": 6.0, "sex": 1.0}
    person = atlas.fit(egg(6.0, 1.0), values).individual
    (shape,) = shapes_along(atlas, template_of(atlas, 48), [values], person)
    found = margins(person, shape, {"volume": VOLUME})
    assert found["volume"] == pytest.approx(person.volume_margin_cm3(person.surface), rel=0.1)
