"""The facade in real units."""

import numpy as np
import pytest
import trimesh

from naisr_model.atlas import Atlas
from naisr_model.errors import Cancelled, InputError
from naisr_model.progress import Progress


@pytest.fixture(scope="module")
def atlas(egg_atlas) -> Atlas:
    return Atlas.load(egg_atlas)


def test_distances_are_millimetres_and_vanish_on_the_surface(atlas):
    values = {"age": 6.0, "sex": 1.0}
    shape = atlas.shape(values, resolution=64)
    assert np.abs(atlas.sdf(shape.vertices, values)).max() < 0.3
    centre, far = atlas.sdf([[0, 0, 0], [0, 0, 45.0]], values)
    assert centre < -10 and far == pytest.approx(45 - shape.bounds[1, 2], abs=4)


def test_the_full_shape_with_one_covariate_moved_is_its_effect(atlas):
    # The other displacements are zero at the centre, so Phi and Phi_i are one and the same there.
    full, effect = atlas.shape({"age": 8.0}, resolution=32), atlas.effect("age", 8.0, resolution=32)
    assert full.vertices == pytest.approx(effect.vertices, abs=1e-3)
    at_centre = atlas.shape({}, resolution=32)
    assert at_centre.vertices == pytest.approx(atlas.template(32).vertices, abs=1e-3)


def test_the_same_question_has_the_same_answer(atlas):
    first, second = (atlas.shape({"age": 3.0}, resolution=32) for _ in range(2))
    assert (first.vertices == second.vertices).all() and (first.faces == second.faces).all()


def test_a_latent_code_changes_the_individual(atlas):
    code = np.zeros(4)
    assert (atlas.shape({"age": 3}, code, 32).vertices == atlas.shape({"age": 3}, None, 32).vertices).all()
    with pytest.raises(InputError, match=r"needs \(4,\)"):
        atlas.shape({"age": 3}, np.zeros(5), 32)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda a: a.shape({"age": 99}), "99 years; the atlas was trained on 1 to 9"),
        (lambda a: a.shape({"height": 1}), "unknown covariate 'height'"),
        (lambda a: a.effect("height", 1), "unknown covariate 'height'"),
        (lambda a: a.template(20), "multiple of 8"),
    ],
)
def test_questions_it_cannot_answer_get_a_sentence(atlas, call, message):
    with pytest.raises(InputError, match=message):
        call(atlas)


def test_extrapolation_is_there_for_those_who_ask(atlas):
    grown = atlas.shape({"age": 10}, resolution=32, extrapolate=True)
    assert isinstance(grown, trimesh.Trimesh) and len(grown.faces)
    fit = atlas.fit(grown, {"age": 10, "sex": 0}, extrapolate=True)
    assert fit.covariates["age"] == pytest.approx(10) and fit.residual_mm < 1
    with pytest.raises(InputError, match="10 years"):
        atlas.fit(grown, {"age": 10})


def test_cancelling(atlas):
    with pytest.raises(Cancelled):
        atlas.shape({}, progress=Progress(is_unwanted=lambda: True))
