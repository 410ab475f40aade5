"""Measures along a covariate and among people, against eggs whose measures are known in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from naisr_viewer.engine.curves import curves, standings
from naisr_viewer.engine.engine import Engine
from naisr_viewer.panels.curves import curve_request
from naisr_viewer.panels.kinds import request_for
from naisr_viewer.state.curves import CurveChoice, CurveRequest, readout
from naisr_viewer.state.drawer import Tab
from naisr_viewer.state.explorer import AVERAGE_KEY, ExplorerState, knowing_norms
from naisr_viewer.state.layouts import Panel
from naisr_viewer.state.pins import Pin
from naisr_viewer.state.requests import EXACT_RESOLUTION

MALE = (("sex", 1.0),)
UNUSUAL, CHANGE = Panel("unusual"), Panel("change")


def asked(state: ExplorerState) -> CurveRequest:
    request = curve_request(state)
    assert request is not None
    return request


def volume_cm3(age: ArrayLike, sex: ArrayLike) -> NDArray[np.float64]:
    return 4 / 3 * np.pi * (20 + 2 * np.asarray(sex)) * 20 * (20 + 2 * np.asarray(age)) / 1000


@pytest.fixture(scope="module", autouse=True)
def coarse():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("naisr_model.measures.curves.COARSE", 32)
        yield


@pytest.fixture(scope="module")
def known(desk):
    """The patient of the desk once it is known what is usual."""
    engine, _, state = desk
    engine.norms(state.atlas.path)
    return engine, knowing_norms(replace(state, drawer=Tab.CURVE))


def test_until_it_is_known_what_is_usual_there_is_a_curve_without_a_band(egg_atlas, tmp_path):
    engine = Engine(folder=tmp_path)
    engine.open(egg_atlas)
    found = curves(engine, CurveRequest(egg_atlas, "age", MALE, 0)).find("volume")
    assert found.band is None and found.observed is None and found.own is None and found.sighting is None
    assert found.path is None  # nothing else grows
    assert standings(engine, egg_atlas, 0) == ()


def test_the_curve_is_that_of_the_eggs_with_the_people_in_its_band(known, egg_atlas):
    engine, _ = known
    answer = curves(engine, CurveRequest(egg_atlas, "age", MALE, 0))
    assert [one.name for one in answer.measures] == ["volume", "area"]
    found = answer.find("volume")
    assert found.usual[3:-3] == pytest.approx(volume_cm3(answer.places, 1.0)[3:-3], rel=0.05)
    assert found.band is not None
    low, high = found.band
    assert (low < found.usual).all() and (found.usual < high).all()
    sexes = engine.atlas(egg_atlas).population.observed("sex")
    assert found.observed == pytest.approx(volume_cm3(answer.visits, sexes), rel=0.06)


def test_of_a_binary_covariate_there_are_the_levels(known, egg_atlas):
    answer = curves(known[0], CurveRequest(egg_atlas, "sex", (("age", 5.0),), 0))
    assert answer.places.tolist() == [-1.0, 1.0]
    assert answer.find("volume").usual == pytest.approx(volume_cm3(5.0, answer.places), rel=0.05)


def test_a_patient_is_seen_on_the_own_line(known):
    engine, state = known
    request = asked(state)
    assert request.person == state.fit.person and request.covariate == "age"
    answer = curves(engine, request)
    found = answer.find("volume")
    assert found.sighting is not None
    assert found.sighting.place == 6.0
    assert found.sighting.value == pytest.approx(state.fit.extent, rel=2e-3)
    assert found.sighting.margin == pytest.approx(state.fit.extent_margin, rel=0.15)
    assert readout(answer, found, 6.0).own == pytest.approx(found.sighting.value, rel=5e-3)


def test_moving_along_the_curve_asks_nothing_new(known):
    _, state = known
    age = state.atlas.index("age")
    values = list(state.values)
    values[age] = 8.0
    assert curve_request(replace(state, values=tuple(values))) == curve_request(state)
    chosen = replace(state, curve=CurveChoice(covariate="sex"))
    assert (asked(chosen).covariate, asked(chosen).others) == ("sex", (("age", 6.0),))
    assert asked(replace(state, touched="sex")).covariate == "sex"
    assert curve_request(replace(state, drawer=Tab.POINT)) is None


def test_how_sure_the_curve_is_lies_within_what_people_have(known, egg_atlas):
    engine, _ = known
    found = curves(engine, CurveRequest(egg_atlas, "age", MALE, 0)).find("volume")
    assert found.sure is not None
    low, high = found.sure
    assert ((low < found.usual) & (found.usual < high)).all() and (np.log(high / low) < 0.1).all()


def test_the_distance_of_two_places_is_that_of_the_poles(known, egg_atlas):
    engine, _ = known
    template = engine.gauge(egg_atlas).fine.points_mm
    ends = [template[template[:, 2].argmin()], template[template[:, 2].argmax()]]
    pins = tuple(Pin(number, tuple(end.tolist())) for number, end in enumerate(ends, start=1))
    found = curves(engine, CurveRequest(egg_atlas, "age", MALE, 0, pins))
    distance = found.find("distance")
    assert distance.usual[3:-3] == pytest.approx(2 * (20 + 2 * found.places)[3:-3], rel=0.04)
    assert distance.band is not None and distance.observed is not None and len(distance.observed) == 19


def test_a_patient_stands_among_people_of_the_same_covariates(known):
    engine, state = known
    volume, area = standings(engine, state.atlas.path, state.fit.person)
    assert (volume.title, volume.unit, area.unit) == ("Volume", "cm³", "cm²")
    assert volume.value == pytest.approx(state.fit.extent, rel=2e-3)
    norm = engine.norms(state.atlas.path).norms(dict(state.fit.values), {"volume": volume.value})["volume"]
    assert (volume.percentile, volume.z) == (norm.percentile, norm.z)


def test_places_beyond_the_band_have_colours_once_it_is_known(desk):
    engine, _, state = desk
    path = state.atlas.path
    before = engine.surface(request_for(state, UNUSUAL, EXACT_RESOLUTION))
    assert before.colouring is None
    norms, request = engine.norms(path), request_for(knowing_norms(state), UNUSUAL, EXACT_RESOLUTION)
    result = engine.surface(request)
    scores = norms.local.scores(norms.atlas, result.points_mm, dict(request.values))
    told, outside = result.colouring.values, np.abs(scores) > 1.959964
    assert ((told != 0) == outside).all()
    assert np.sign(told[outside]).tolist() == np.sign(scores[outside]).tolist()
    assert np.abs(told[outside]) == pytest.approx(np.abs(scores[outside]) - 1.959964, abs=1e-4)


def test_a_patient_is_compared_with_the_average_at_the_same_covariates(desk):
    engine, _, state = desk
    state = replace(state, compared=AVERAGE_KEY)
    result = engine.surface(request_for(state, CHANGE, EXACT_RESOLUTION))
    assert result.request.before == (0, state.named)
    average = engine.atlas(state.atlas.path).sdf(result.points_mm, dict(state.named))
    assert result.colouring.values == pytest.approx(average, abs=0.4)
    assert np.corrcoef(result.colouring.values, average)[0, 1] > 0.9


def test_what_is_usual_is_worked_out_once(known, egg_atlas, monkeypatch):
    engine, _ = known
    engine.open(egg_atlas)  # anew, and nobody is fitted any more
    assert engine.known_norms(egg_atlas) is None
    monkeypatch.setattr("naisr_model.measures.norms.people_of", None)
    assert engine.norms(egg_atlas) is engine.known_norms(egg_atlas)
