"""Measures along a covariate: tracked, exact and of a person."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from eggs import egg

from naisr_model.atlas import Atlas
from naisr_model.covariates import normalised_vector
from naisr_model.measures.curves import along, curve, shapes_along
from naisr_model.measures.kinds import MEASURES, VOLUME, surface_of
from naisr_model.surface.volume import enclosed_volume


@pytest.fixture(scope="module")
def atlas(egg_atlas) -> Atlas:
    return Atlas.load(egg_atlas)


@pytest.fixture(scope="module")
def mesh(atlas):
    return atlas.template(64)


@pytest.fixture(scope="module")
def template(mesh):
    return surface_of(mesh)


AGES = (2.0, 4.5, 8.0)


def test_only_one_covariate_moves():
    assert along({"age": 1.0, "sex": -1.0}, "age", AGES[:2]) == [
        {"age": 2.0, "sex": -1.0},
        {"age": 4.5, "sex": -1.0},
    ]


def test_a_curve_is_the_volume_of_the_eggs(atlas, template):
    volumes = curve(VOLUME, shapes_along(atlas, template, along({"sex": 1.0}, "age", AGES)))
    truth = [4 / 3 * np.pi * 22 * 20 * (20 + 2 * age) / 1000 for age in AGES]
    assert volumes == pytest.approx(truth, rel=0.05)


def test_vertices_that_are_carried_enclose_what_the_surface_does(atlas, template):
    (shape,) = shapes_along(atlas, template, [{"age": 8.0, "sex": 1.0}])
    found = atlas.shape({"age": 8.0, "sex": 1.0}, resolution=96)
    exact = enclosed_volume(found.vertices, found.vertex_normals, found.faces) / 1000
    assert VOLUME.of(shape) == pytest.approx(exact, rel=5e-3)


def test_a_tracker_gives_the_same_curve(atlas, mesh, template):
    way = along({"sex": -1.0}, "age", AGES)
    tracker = atlas.tracker(mesh, atlas.tabulate(mesh))
    exact = shapes_along(atlas, template, way)
    tracked = shapes_along(atlas, template, way, tracker=tracker)
    for name in ("volume", "area"):
        assert curve(MEASURES[name], tracked) == pytest.approx(curve(MEASURES[name], exact), rel=5e-3)


def test_a_person_has_a_curve_of_their_own(atlas, template):
    fit = atlas.fit(egg(6.0, 1.0), {"age": 6.0, "sex": 1.0})
    person = dataclasses.replace(fit.individual, latent=30 * atlas.checkpoint.latents[0].astype(float))
    way = along({"sex": 1.0}, "age", (6.0, 8.0))
    own, usual = (curve(VOLUME, shapes_along(atlas, template, way, one)) for one in (person, None))
    later = person.elsewhere(normalised_vector(atlas.covariates, way[1]))
    assert own == pytest.approx([person.volume_cm3, later.volume_cm3], rel=5e-3)
    assert np.abs(own / usual - 1).max() > 0.01
