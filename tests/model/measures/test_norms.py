"""What is usual, among people who differ as they were told to."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import trimesh
from eggs import untrained
from safetensors.numpy import load_file, save_file
from scipy.stats import norm as normal

from naisr_model.atlas import Atlas
from naisr_model.errors import InputError
from naisr_model.measures.curves import Gauge
from naisr_model.measures.kept import load_norms, save_norms
from naisr_model.measures.kinds import MEASURES, VOLUME, surface_of
from naisr_model.measures.norms import WIDENING, People, local_spread_of, norms_of, people_of, spread_of
from naisr_model.measures.report import measure_record

SD = 0.05
"""Of the logarithm of a ball's radius among people of the same age."""


@pytest.fixture(scope="module")
def balls() -> People:
    """Balls as large in millimetres as people are old, more or less."""
    template = surface_of(trimesh.creation.icosphere(subdivisions=2, radius=1.0))
    ages = np.linspace(5.0, 15.0, 40)
    larger = np.exp(SD * normal.ppf((np.random.default_rng(0).permutation(40) + 0.5) / 40))
    usual = ages[:, None, None] * template.points_mm
    rows = tuple({"age": float(age)} for age in ages)
    return People(rows, template, larger[:, None, None] * usual, usual)


def test_the_spread_of_a_measure_is_that_of_the_people(balls):
    for name, power in (("area", 2), ("volume", 3)):
        spread = spread_of(balls, MEASURES[name])
        assert spread.centre == pytest.approx(0, abs=1e-6)
        assert spread.sd == pytest.approx(WIDENING * power * SD, rel=0.05)


def test_a_value_stands_among_people_of_the_same_covariates(balls):
    spread = spread_of(balls, VOLUME)
    usual = spread.norm(100.0, 100.0)
    assert usual.z == pytest.approx(0, abs=1e-6) and usual.percentile == pytest.approx(50)
    assert usual.median == pytest.approx(100)
    large = spread.norm(usual.high, 100.0)
    assert large.z == pytest.approx(1.96, abs=1e-3) and large.percentile == pytest.approx(97.5)
    assert np.log(usual.high / usual.low) == pytest.approx(2 * 1.96 * WIDENING * 3 * SD, rel=0.05)
    low, high = spread.band([50.0, 100.0])
    assert (low[1], high[1]) == pytest.approx((usual.low, usual.high)) and high[0] == pytest.approx(
        high[1] / 2
    )


def test_percentiles_of_the_people_themselves_are_spread_evenly(balls):
    spread = spread_of(balls, VOLUME)
    pairs = zip(balls.own(VOLUME), balls.usual(VOLUME), strict=True)
    scores = np.sort([WIDENING * spread.norm(own, usual).z for own, usual in pairs])
    assert np.abs(normal.cdf(scores) - (np.arange(40) + 0.5) / 40).max() < 0.025


def test_measures_of_a_coarse_surface_are_as_of_a_fine_one(balls):
    gauge = Gauge(surface_of(trimesh.creation.icosphere(subdivisions=4, radius=1.0)), balls.template)
    shapes = [balls.template.moved(points_mm) for points_mm in balls.own_mm]
    radii = np.cbrt(gauge.curve(VOLUME, shapes) * 1000 * 3 / (4 * np.pi))
    truth = np.linalg.norm(balls.own_mm[:, 0], axis=1)
    assert radii == pytest.approx(truth, rel=2e-3)


def test_the_local_spread_is_that_of_the_radius(balls):
    shares = local_spread_of(balls).shares * np.cbrt(4 / 3 * np.pi)
    assert shares == pytest.approx(WIDENING * SD, rel=0.1)


def test_what_has_no_norm_is_refused(balls):
    with pytest.raises(InputError, match="have no length"):
        spread_of(balls, MEASURES["length"])
    with pytest.raises(InputError, match="needs a value above 0"):
        spread_of(balls, VOLUME).norm(0.0, 10.0)


def test_people_who_are_all_alike_have_no_spread(balls):
    alike = dataclasses.replace(balls, own_mm=balls.usual_mm)
    with pytest.raises(InputError, match="does not tell its people apart"):
        spread_of(alike, VOLUME)


def test_a_few_people_are_no_population():
    with pytest.raises(InputError, match="trained on 5 shapes; what is usual takes 10 or more"):
        people_of(Atlas(untrained()), surface_of(trimesh.creation.icosphere()))


@pytest.fixture(scope="module")
def norms(egg_atlas):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("naisr_model.measures.curves.COARSE", 32)
        yield norms_of(Atlas.load(egg_atlas))


def test_training_people_are_reconstructed(norms):
    ages, sexes = (norms.atlas.population.observed(name) for name in ("age", "sex"))
    assert len(ages) == 19
    truth = [
        4 / 3 * np.pi * (20 + 2 * s) * 20 * (20 + 2 * a) / 1000 for a, s in zip(ages, sexes, strict=True)
    ]
    assert norms.own["volume"] == pytest.approx(truth, rel=0.06)


def test_norms_are_kept_without_shapes(norms, tmp_path):
    file = tmp_path / "norms.safetensors"
    save_norms(norms, file)
    assert file.stat().st_size < 60_000
    again, values = load_norms(file, norms.atlas), {"age": 6.0, "sex": 1.0}
    assert measure_record(again, values) == measure_record(norms, values)
    points = 1.05 * np.asarray(norms.gauge.coarse.points_mm)
    kept, fresh = (each.local.scores(norms.atlas, points, values) for each in (again, norms))
    assert np.array_equal(kept, fresh)


@pytest.mark.parametrize("name", ["own.volume", "ratios.area", "offsets"])
def test_damaged_norms_are_refused(norms, tmp_path, name):
    file = tmp_path / "norms.safetensors"
    save_norms(norms, file)
    good = load_file(file)
    for bad in ({name: good[name][1:]}, {name: np.full_like(good[name], np.nan)}):
        save_file(good | bad, file)
        with pytest.raises(InputError, match=f"'{name}' is not"):
            load_norms(file, norms.atlas)
    file.write_bytes(b"no tensors")
    with pytest.raises(InputError, match="does not hold what is usual"):
        load_norms(file, norms.atlas)


def test_a_shape_is_told_among_its_people(norms):
    record = measure_record(norms, {"age": 6.0, "sex": 1.0})
    assert record["measures"].keys() == {"volume", "area"} and "outside" not in record
    volume = record["measures"]["volume"]
    assert volume["sure_low"] < volume["value"] < volume["sure_high"]
    assert volume["low"] < volume["value"] < volume["high"] and 10 < volume["percentile"] < 90
    assert record["covariates"] == {"age": 6.0, "sex": 1.0}


def test_places_of_the_surface_are_judged_by_their_own_spread(norms):
    atlas, values = norms.atlas, {"age": 6.0, "sex": 1.0}
    (points,) = atlas.carried_mm(norms.gauge.fine.points_mm, [values])
    sd = norms.local.sd_mm(atlas, points, values)
    assert sd.shape == (len(points),) and (sd > 0).all() and sd.max() < 1.5
    outward = points + sd[:, None] * points / np.linalg.norm(points, axis=1, keepdims=True)
    here, there = (norms.local.scores(atlas, place, values) for place in (points, outward))
    assert np.median(there - here) == pytest.approx(1, rel=0.15)


def test_the_population_is_surest_where_its_people_are(norms):
    ways = [{"age": age} for age in (1.0, 5.0, 9.0)]
    usual = np.array([norms.usual(values)["volume"] for values in ways])
    low, high = norms.intervals("volume", ways, usual)
    assert ((low < usual) & (usual < high)).all() and (np.log(high / low) < 0.05).all()
    assert np.log(high / low)[1] < np.log(high / low)[[0, 2]].min()


def test_an_effect_is_surer_the_nearer_to_the_centre(norms):
    origins = np.asarray(norms.gauge.fine.points_mm)[::50]
    centre = norms.atlas.population.centre["age"]
    margins = norms.effect_margins_mm(origins, [{"age": centre + years} for years in (0.0, 1.0, 4.0)])
    assert margins[0] == pytest.approx(0, abs=1e-9)
    assert (margins[1] > 0).all() and np.mean(margins[1]) < np.mean(margins[2]) < 2
