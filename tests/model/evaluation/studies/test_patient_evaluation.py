"""Transfer and completion are measured against truth that is known in closed form."""

from __future__ import annotations

import dataclasses
import json
from collections import Counter
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from eggs import egg

from naisr_model import cli
from naisr_model.atlas import Atlas
from naisr_model.checkpoint import load
from naisr_model.errors import Cancelled
from naisr_model.evaluation.metrics import compare
from naisr_model.evaluation.reports import PUBLISHED_AIRWAY_TRANSFER
from naisr_model.evaluation.studies import completion, reconstruction, transfer
from naisr_model.evaluation.studies.reconstruction import HeldOut


@dataclasses.dataclass(frozen=True)
class Visit:
    """An egg on one day; ``larger`` is what its covariates do not tell."""

    subject: str
    visit: str
    values: dict
    larger: float


@pytest.fixture(scope="module")
def families(egg_atlas):
    """The atlas of the eggs with its first two held-out eggs of one sex as one subject's visits."""
    checkpoint = load(egg_atlas)
    population = checkpoint.population
    rows = np.flatnonzero(population.held_out)
    sexes = population.values[rows, population.names.index("sex")]
    twins = rows[sexes == Counter(sexes).most_common(1)[0][0]][:2]
    subjects, visits = list(population.subjects), list(population.visits)
    subjects[twins[1]], visits[twins[1]] = subjects[twins[0]], "2"
    people = dataclasses.replace(population, subjects=tuple(subjects), visits=tuple(visits))
    return Atlas(dataclasses.replace(checkpoint, population=people, source={"seed": 0, "patients": 24}))


@pytest.fixture
def known_truth(families, monkeypatch):
    """A population module that makes any of the eggs at any covariates."""
    people = families.population

    def everybody(seed: int, patients: int) -> list[Visit]:
        names = zip(people.subjects, people.visits, strict=True)
        return [Visit(*name, people.row(row), 1.02) for row, name in enumerate(names)]

    def made(visit: Visit) -> tuple[trimesh.Trimesh, dict]:
        return egg(visit.values["age"], visit.values["sex"]).apply_scale(visit.larger), {}

    module = SimpleNamespace(visits=everybody, visit_shape=made)
    for place in (reconstruction, transfer):
        monkeypatch.setattr(place, "synthetic", lambda atlas: module)
    monkeypatch.setattr(transfer, "compare", partial(compare, samples=500, emd_samples=50))


@pytest.mark.usefixtures("known_truth")
def test_other_visits_and_other_covariates_are_predicted(families):
    report = transfer.transfer(families)
    held_out = int(families.population.held_out.sum())
    visits, elsewhere = report["visits"], report["counterfactuals"]
    assert (visits["n"], visits["subjects"]) == (1, 1)
    assert elsewhere["n"] == elsewhere["subjects"] == held_out - 1
    for case in [*visits["cases"], *elsewhere["cases"]]:
        true_cm3 = 1.02**3 * egg(case["values"]["age"], case["values"]["sex"]).volume / 1000
        assert case["measured_cm3"] == pytest.approx(true_cm3, rel=1e-6)
        assert case["values"]["sex"] == case["fitted_values"]["sex"]
        assert case["values"]["age"] != case["fitted_values"]["age"]
        assert case["given"]["volume_cm3"] == pytest.approx(true_cm3, rel=0.12)
        assert case["average"]["interval_cm3"] is None and case["kept"]["interval_cm3"] is None
        volumes = sorted(case[way]["volume_cm3"] for way in ("kept", "average"))
        assert 0.99 * volumes[0] < case["given"]["volume_cm3"] < 1.01 * volumes[1]
    assert 0 <= elsewhere["given"]["held"] <= 1
    assert elsewhere["average"]["held"] is None and elsewhere["kept"]["held"] is None
    assert elsewhere["inferred"]["n"] == elsewhere["n"]
    assert json.loads(json.dumps(report)) == report
    text = transfer.transfer_markdown(report, PUBLISHED_AIRWAY_TRANSFER)
    assert "11.23 / 9.65" in text and "fitted at visit 1" in text and "real patients" in text
    for block in text.split("\n\n"):
        assert len({line.count("|") for line in block.splitlines() if line.startswith("|")}) <= 1


@pytest.mark.usefixtures("known_truth")
def test_transfer_keeps_to_the_limit_and_can_be_stopped(families):
    few = transfer.transfer(families, limit=1)
    assert few["visits"]["n"] == 1 and few["counterfactuals"]["subjects"] == 1
    with pytest.raises(Cancelled):
        transfer.transfer(families, should_stop=lambda: True)


def test_transfer_of_people_seen_once_is_refused_where_no_truth_is_known(egg_atlas, egg_store, capsys):
    words = ["evaluate", "transfer", str(egg_atlas), "--store", str(egg_store.path)]
    assert cli.main(words) == 2
    assert "nobody held out was seen twice" in capsys.readouterr().err


@pytest.mark.parametrize("cut", completion.CUTS)
def test_a_third_of_the_area_is_cut_away(cut):
    mesh = egg(6.0, 1.0).subdivide()
    missing = completion.cut_away(mesh, cut, seed=1)
    assert mesh.area_faces[missing].sum() / mesh.area == pytest.approx(1 / 3, abs=0.01)
    heights = mesh.triangles_center[:, 2]
    if cut == "below":
        assert heights[missing].max() <= heights[~missing].min()
    elif cut == "above":
        assert heights[missing].min() >= heights[~missing].max()
    else:
        assert (missing != completion.cut_away(mesh, cut, seed=2)).any()
        pieces = mesh.submesh([np.flatnonzero(missing)], append=True).body_count
        assert pieces == 1


def test_completion_measures_both_parts_from_the_command_line(egg_atlas, egg_store, tmp_path, capsys):
    record = tmp_path / "completion.json"
    words = ["evaluate", "completion", str(egg_atlas), "--store", str(egg_store.path)]
    assert cli.main([*words, "--limit", "1", "--json", str(record)]) == 0
    report, text = json.loads(record.read_text()), capsys.readouterr().out
    assert report["n"] == 1 and "from below, covariates inferred" in text
    for cut in completion.CUTS:
        for way in completion.WAYS:
            assert report[cut][way]["seen_mm"]["mean"] < 2.5
            assert report[cut][way]["missing_mm"]["mean"] < report[cut][way]["missing_hd95_mm"]["mean"] < 12
        assert report[cut]["given"]["missing_mm"]["mean"] < 2.5
    assert cli.main([*words, "--limit", "-1"]) == 2
    assert "--limit is -1" in capsys.readouterr().err


def test_the_missing_part_is_told_from_the_seen_one(egg_atlas):
    """An atlas's own shape, cut, and a wrong shape that is right where the cut left something."""
    mesh = egg(6.0, 1.0).subdivide()
    longer = mesh.copy()
    longer.vertices[:, 2] *= np.where(longer.vertices[:, 2] < 0, 1.2, 1.0)
    missing = completion.cut_away(mesh, "below")
    found = completion._measured(HeldOut({}, mesh), missing, longer, None)
    assert found is not None
    assert found.seen_mm < 0.6 < 1.5 < found.missing_mm < found.missing_hd95_mm <= 0.2 * 32 + 0.1
    assert found.vd_cm3 == pytest.approx(abs(longer.volume - mesh.volume) / 1000)
    assert completion._measured(HeldOut({}, mesh), missing, trimesh.Trimesh(), None) is None
