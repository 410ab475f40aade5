"""The atlases that come with the program tell the truth about the populations they were made from."""

from pathlib import Path

import numpy as np
import pytest
import torch

from naisr_model.atlas import Atlas
from naisr_model.checkpoint import load
from naisr_model.config import read_toml
from naisr_model.covariates import normalised_vector
from naisr_model.data.align import rigid_transform
from naisr_model.data.populations import airway, starman
from naisr_model.evaluation.held_out import held_out, held_out_rows
from naisr_model.evaluation.metrics import HAUSDORFF, Pair, compare, component_count
from naisr_model.evaluation.truth import plausible_values
from naisr_model.models.factory import preset
from naisr_model.shipped import ATLASES, shipped_atlas
from naisr_model.surface.fields import shape_field
from naisr_model.surface.isosurface import isosurface
from naisr_model.surface.lattice import Lattice
from naisr_model.surface.sparse import evaluate_band, evaluate_everywhere

PRESETS = {"starman": "starman-demo"}
RESOURCES = Path(__file__).parents[2] / "resources"


@pytest.fixture(scope="module")
def atlas() -> Atlas:
    return Atlas.load(RESOURCES / "airway.safetensors")


@pytest.mark.parametrize("name", ATLASES)
def test_the_settings_beside_an_atlas_are_those_it_was_trained_with(name):
    settings = read_toml(RESOURCES / f"{name}.toml", preset(PRESETS.get(name, "demo")))
    assert load(RESOURCES / f"{name}.safetensors").preset == settings


def test_the_program_finds_its_atlas():
    assert shipped_atlas() == RESOURCES / "airway.safetensors"


@pytest.mark.parametrize("name", ["airway", "bodies"])
def test_they_load_and_stay_small(name):
    path = RESOURCES / f"{name}.safetensors"
    assert path.stat().st_size < 8e6
    shape = Atlas.load(path).template(128)
    assert shape.is_watertight and component_count(shape) == 1


def test_little_men_lift_their_arms_and_split_their_legs_as_the_generator_s_do():
    path = shipped_atlas("starman")
    assert path.stat().st_size < 2e6
    men = Atlas.load(path)
    for moved, _, values in starman.growth_path():
        truth, shape = starman.true_shape(values), men.effect(moved, values[moved])
        if values == {**men.population.centre, **dict.fromkeys(values, 0.0), moved: values[moved]}:
            assert component_count(shape) == 1
            assert shape.volume == pytest.approx(truth.volume, rel=0.08)
            assert HAUSDORFF.measure(Pair(truth, shape, samples=2000)) <= 9


@pytest.mark.parametrize("sex", [-1.0, 1.0])
@pytest.mark.parametrize("age", airway.PATH_AGES_MONTHS)
def test_growth_is_the_generator_s_growth(atlas, age, sex):
    values = {"age": age, "weight": airway.median_weight_kg(age, sex), "sex": sex}
    shape = atlas.shape(values, resolution=128)
    truth = airway.true_shape(values)
    truth.apply_transform(rigid_transform(atlas.checkpoint.alignment, truth, airway.true_landmarks(values)))
    assert component_count(shape) == 1
    assert shape.volume == pytest.approx(truth.volume, rel=0.1)
    assert HAUSDORFF.measure(Pair(truth, shape, samples=10_000)) <= 6


@pytest.mark.parametrize("name", ["age", "weight"])
def test_single_effects_are_the_generator_s(atlas, name):
    covariate = atlas.covariates[atlas.population.names.index(name)]
    for value in plausible_values(atlas.population, covariate)[::4]:
        truth = airway.true_shape(atlas.population.centre | {name: value})
        assert atlas.effect(name, value, resolution=128).volume == pytest.approx(truth.volume, rel=0.15)


def test_sliders_show_one_piece_from_end_to_end(atlas):
    for covariate in atlas.covariates:
        low, high = covariate.range
        for value in np.linspace(low, high, 5):
            assert component_count(atlas.effect(covariate.name, float(value), resolution=96)) == 1


def test_nothing_folds_near_the_surface(atlas):
    assert atlas.checkpoint.training["folded_share"] < 0.01


def test_the_template_stands_where_the_mean_shape_stands(atlas):
    truth = airway.true_shape(atlas.population.centre)
    assert atlas.template(128).volume == pytest.approx(truth.volume, rel=0.1)


def test_patients_are_held_out_whole(atlas):
    population = atlas.population
    groups = [
        {
            subject
            for subject, held in zip(population.subjects, population.held_out, strict=True)
            if held == side
        }
        for side in (True, False)
    ]
    assert not groups[0] & groups[1]
    assert len(population) == 357 and len(groups[0]) == pytest.approx(0.2 * 263, abs=1)


def test_the_band_misses_nothing_of_a_real_atlas(atlas):
    model, lattice, rng = atlas.checkpoint.model(), Lattice(64), np.random.default_rng(0)
    low, high = np.array([covariate.range for covariate in atlas.covariates]).T
    for _ in range(3):
        values = dict(zip(atlas.population.names, rng.uniform(low, high), strict=True))
        vector = torch.as_tensor(normalised_vector(atlas.covariates, values), dtype=torch.float32)
        latent = torch.as_tensor(atlas.checkpoint.latents[rng.integers(len(atlas.checkpoint.latents))])
        field = shape_field(model, vector, latent)
        dense = isosurface(evaluate_everywhere(field, lattice), lattice, atlas.frame)
        banded = isosurface(evaluate_band(field, lattice), lattice, atlas.frame)
        assert (dense.faces == banded.faces).all()
        assert np.abs(dense.vertices - banded.vertices).max() < 1e-5 * 2 * atlas.frame.scale_mm


def test_unseen_patients_are_reconstructed(atlas):
    for row in held_out_rows(atlas, 3):
        shape = held_out(atlas, None, row)
        fit = atlas.fit(shape.mesh_mm, shape.values, extrapolate=True)
        distances = compare(shape.mesh_mm, fit.shape(), emd_samples=50)
        assert distances["cd_x100"] < 0.06
        assert distances["hd_x100"] < 10
