"""People from the anny package, against growth charts and plain geometry."""

from __future__ import annotations

import os

import numpy as np
import pytest

from naisr_model.data.align import Alignment
from naisr_model.data.meshes import check_mesh, read_mesh, repair_mesh
from naisr_model.data.prepare import PrepareOptions, prepare
from naisr_model.data.samples import signed_distance
from naisr_model.data.store import SampleStore
from naisr_model.data.tables import read_table
from naisr_model.errors import Cancelled, InputError

pytest.importorskip("anny")

from naisr_model.data.populations import PopulationModule, bodies, population
from naisr_model.progress import Progress

# Median standing heights in cm, girls and boys, rounded: child growth standards (1, 2, 5 years) and
# reference 2007 (10, 19 years) of the World Health Organization.
HEIGHTS_CM = {1: (74.0, 75.7), 2: (85.7, 87.1), 5: (109.4, 110.0), 10: (138.6, 137.8), 19: (163.2, 176.5)}


@pytest.fixture(scope="module", autouse=True)
def _no_network():
    """The model must build from what the package carries."""
    before = {name: os.environ.get(name) for name in ("HTTP_PROXY", "HTTPS_PROXY")}
    os.environ.update(dict.fromkeys(before, "http://127.0.0.1:9"))
    yield
    for name, value in before.items():
        os.environ.pop(name) if value is None else os.environ.update({name: value})


def person(age, weight=50.0, sex=-1.0):
    return bodies.true_shape({"age": age, "weight": weight, "sex": sex})


def height_cm(mesh) -> float:
    return float(np.ptp(mesh.vertices[:, 2])) / 10


@pytest.mark.parametrize("age", HEIGHTS_CM)
def test_heights_follow_the_growth_charts(age):
    girl, boy = HEIGHTS_CM[age]
    assert height_cm(person(age, sex=-1.0)) == pytest.approx(girl, rel=0.08)
    assert height_cm(person(age, sex=1.0)) == pytest.approx(boy, rel=0.08)


@pytest.mark.parametrize(
    ("age", "weight", "sex"), [(1, 0, -1), (6, 100, 1), (30, 100, -1), (80, 20, 1), (40, 50, 0)]
)
def test_a_body_is_one_closed_outward_surface_about_the_pelvis(age, weight, sex):
    mesh = person(float(age), float(weight), float(sex))
    assert mesh.is_watertight
    assert mesh.body_count == 1
    assert mesh.volume > 0
    assert check_mesh(repair_mesh(mesh)[0]) == ()
    low, high = mesh.bounds
    assert low[2] < 0 < high[2]
    assert 0.4 < -low[2] / (high[2] - low[2]) < 0.65
    np.testing.assert_allclose(low[0], -high[0], rtol=0.05)
    pelvis, beside = signed_distance(mesh, np.array([[0.0, 0.0, 0.0], [high[0], 0.0, low[2]]]))
    assert pelvis < 0 < beside


def test_effects_have_the_right_direction():
    adult = person(30.0)
    assert person(30.0, weight=100.0).volume > 1.1 * person(30.0, weight=0.0).volume
    assert person(30.0, sex=1.0).volume > adult.volume
    volumes = [person(age).volume for age in (1.0, 4.0, 8.0, 12.0, 16.0)]
    assert volumes == sorted(volumes)
    between = height_cm(person(30.0, sex=0.0))
    assert height_cm(person(30.0, sex=-1.0)) < between < height_cm(person(30.0, sex=1.0))
    # An adult of 30 to 90 litres.
    assert 3e7 < adult.volume < 9e7


def test_the_cohort_is_plausible_and_repeatable():
    everybody = bodies.visits(seed=3)
    assert len(everybody) == 200
    assert len({v.subject for v in everybody}) == 200
    ages, weights, sexes = (np.array([v.values[n] for v in everybody]) for n in ("age", "weight", "sex"))
    assert (sexes == 1).sum() == 100
    assert ages.min() < 2 and ages.max() > 78
    assert np.median(ages) == pytest.approx(18, abs=1)
    assert abs(np.corrcoef(ages, weights)[0, 1]) < 0.2
    assert everybody == bodies.visits(seed=3)
    assert everybody != bodies.visits(seed=4)
    with pytest.raises(InputError, match="at least 1"):
        bodies.visits(seed=0, patients=0)


def test_people_of_the_same_values_differ():
    values = {"age": 30.0, "weight": 50.0, "sex": 1.0}
    tall, short = (
        bodies.visit_shape(bodies.Visit("x", "1", values, bodies.Variation(height=score)))[0]
        for score in (1.5, -1.5)
    )
    usual = height_cm(bodies.true_shape(values))
    assert height_cm(short) + 5 < usual < height_cm(tall) - 5


def test_a_missing_value_is_named():
    with pytest.raises(InputError, match="'sex'"):
        bodies.true_shape({"age": 3.0, "weight": 50.0})


def test_the_population_goes_through_the_pipeline(tmp_path):
    module: PopulationModule = bodies  # what the type checker must agree with
    assert population("bodies") is module
    fractions: list[float] = []
    csv = bodies.write_population(
        tmp_path / "people", seed=0, patients=5, progress=Progress(fractions.append)
    )
    assert fractions[-1] == 1.0
    table = read_table(csv)
    assert [(c.name, c.unit, c.kind) for c in table.covariates] == [
        ("age", "years", "continuous"),
        ("weight", "%", "continuous"),
        ("sex", "", "binary"),
    ]
    assert (table.name, table.alignment) == ("bodies", Alignment())
    assert table.source == {"population": "bodies", "seed": 0, "patients": 5}
    for row, visit, values in zip(table.rows, bodies.visits(0, 5), table.values, strict=True):
        np.testing.assert_array_equal(values, [visit.values[name] for name in ("age", "weight", "sex")])
        mesh, landmarks = bodies.visit_shape(visit)
        assert landmarks == bodies.true_landmarks(visit.values) == {}
        np.testing.assert_allclose(read_mesh(row.mesh).bounds, mesh.bounds, atol=1e-2)
    options = PrepareOptions(surface_samples=200, near_samples=200, uniform_samples=200, workers=1)
    report = prepare(csv, tmp_path / "store", options=options)
    assert len(report.accepted) == 5
    assert (report.warnings, report.rejected) == ((), ())
    assert SampleStore.open(tmp_path / "store").source["population"] == "bodies"


def test_writing_can_be_cancelled(tmp_path):
    with pytest.raises(Cancelled):
        bodies.write_population(tmp_path, seed=0, patients=3, progress=Progress(is_unwanted=lambda: True))
    assert not (tmp_path / "data.csv").exists()


def test_the_growth_path_is_where_truth_exists():
    path = bodies.growth_path()
    assert {(name, condition) for name, condition, _ in path} == {("age", "female"), ("age", "male")}
    assert all(set(values) == {"age", "weight", "sex"} for _, _, values in path)
    assert all(bodies.MIN_AGE_YEARS <= values["age"] <= bodies.MAX_AGE_YEARS for _, _, values in path)
