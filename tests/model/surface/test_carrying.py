"""Points carried to many shapes at once, against Newton's method one by one."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from eggs import untrained

from naisr_model.atlas import Atlas
from naisr_model.errors import Cancelled, InputError
from naisr_model.progress import Progress


@pytest.fixture(scope="module")
def atlas(egg_atlas) -> Atlas:
    return Atlas.load(egg_atlas)


@pytest.fixture(scope="module")
def origins(atlas):
    return atlas.template(32).vertices


PEOPLE = [
    {"age": age, "sex": sex} for age, sex in ((1.5, -1.0), (3.0, 1.0), (5.0, 0.3), (7.0, -1.0), (8.5, 1.0))
]


def test_it_is_what_newtons_method_finds(atlas, origins):
    codes = 3 * atlas.checkpoint.latents[: len(PEOPLE)]
    for values, code, found in zip(PEOPLE, codes, atlas.carried_mm(origins, PEOPLE, codes), strict=True):
        expected = atlas.contributions(origins, values, code).points_mm
        np.testing.assert_allclose(found, expected, atol=0.02)


def test_nobody_in_particular_is_the_average(atlas, origins):
    (found,) = atlas.carried_mm(origins, PEOPLE[:1])
    assert np.abs(atlas.sdf(found, PEOPLE[0])).max() < 0.1


def test_what_cannot_be_is_refused(atlas, origins, egg_deepsdf):
    with pytest.raises(InputError, match="the atlas was trained on 1 to"):
        atlas.carried_mm(origins, [{"age": 99.0}])
    with pytest.raises(InputError, match="deforms no template"):
        Atlas.load(egg_deepsdf).carried_mm(origins, [{}])


def test_points_where_the_deformation_folds_are_told(origins):
    checkpoint = untrained()
    wild = {name: 30 * tensor for name, tensor in checkpoint.weights.items()}
    folded = Atlas(dataclasses.replace(checkpoint, weights=wild))
    with pytest.raises(InputError, match="folds"):
        folded.carried_mm(origins, [{"age": 9.0, "sex": 1.0}])


def test_nobody_waits_any_more(atlas, origins):
    with pytest.raises(Cancelled):
        atlas.carried_mm(origins, PEOPLE, progress=Progress(is_unwanted=lambda: True))
