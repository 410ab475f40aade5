"""Transfer is measured against people who are known at any covariates."""

from __future__ import annotations

import json
from functools import partial

import pytest
from eggs import egg

from naisr_model import cli
from naisr_model.errors import Cancelled
from naisr_model.evaluation.held_out import opened
from naisr_model.evaluation.metrics import compare
from naisr_model.evaluation.studies import transfer
from naisr_model.evaluation.studies.transfer import Transfer
from naisr_model.evaluation.study import run
from naisr_model.progress import Progress
from naisr_model.shipped import shipped_atlas


@pytest.fixture(autouse=True)
def few_samples(monkeypatch) -> None:
    monkeypatch.setattr(transfer, "compare", partial(compare, samples=500, emd_samples=50))


def test_other_visits_and_other_covariates_are_predicted(egg_people):
    report = run(Transfer(egg_people.atlas))
    held_out = int(opened(egg_people.atlas).population.held_out.sum())
    visits, elsewhere = report["visits"], report["counterfactuals"]
    assert (visits["n"], visits["subjects"]) == (1, 1)
    assert elsewhere["n"] == elsewhere["subjects"] == held_out - 1
    for case in [*visits["cases"], *elsewhere["cases"]]:
        true_cm3 = egg_people.larger**3 * egg(case["values"]["age"], case["values"]["sex"]).volume / 1000
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
    text = Transfer(shipped_atlas()).markdown(report)
    assert "11.23 / 9.65" in text and "fitted at visit 1" in text and "real patients" in text
    assert "published" not in Transfer(egg_people.atlas).markdown(report)
    for block in text.split("\n\n"):
        assert len({line.count("|") for line in block.splitlines() if line.startswith("|")}) <= 1


def test_it_keeps_to_the_limit_and_can_be_stopped(egg_people):
    few = run(Transfer(egg_people.atlas, limit=1))
    assert few["visits"]["n"] == 1 and few["counterfactuals"]["subjects"] == 1
    with pytest.raises(Cancelled):
        run(Transfer(egg_people.atlas), progress=Progress(is_unwanted=lambda: True))


def test_people_seen_once_are_refused_where_no_truth_is_known(egg_atlas, egg_store, capsys):
    words = ["evaluate", "transfer", str(egg_atlas), "--store", str(egg_store.path)]
    assert cli.main(words) == 2
    assert "nobody held out was seen twice" in capsys.readouterr().err


def test_a_model_that_carries_no_shapes_to_other_covariates_is_refused(egg_deepsdf, egg_store, capsys):
    words = ["evaluate", "transfer", str(egg_deepsdf), "--store", str(egg_store.path)]
    assert cli.main(words) == 2
    assert "DeepSDF does not carry shapes to other covariates" in capsys.readouterr().err
