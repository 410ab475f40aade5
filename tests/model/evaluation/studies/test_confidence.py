"""How sure the population is, held against a truth that is known."""

from __future__ import annotations

import pytest

from naisr_model import cli
from naisr_model.errors import InputError
from naisr_model.evaluation import truth
from naisr_model.evaluation.studies.confidence import ConfidenceStudy
from naisr_model.evaluation.study import run


def test_every_place_of_the_truth_is_beside_its_interval(egg_people, monkeypatch, capsys):
    monkeypatch.setattr("naisr_model.measures.curves.COARSE", 32)
    monkeypatch.setattr("naisr_model.evaluation.studies.confidence.RESOLUTION", 32)
    monkeypatch.setattr(truth, "EFFECT_VALUES", 2)
    report = run(ConfidenceStudy((egg_people.atlas,)))
    assert report["atlases"] == 1
    assert {name: row["n"] for name, row in report["rows"].items()} == {
        "growth path": 2,
        "age alone": 2,
        "sex alone": 2,
        "template": 1,
    }
    for row in report["rows"].values():
        assert 0 <= row["inside"] <= 1 and 0 < row["half"] < 0.1 and row["largest"] < 0.1
    assert cli.main(["evaluate", "confidence", str(egg_people.atlas)]) == 0
    assert "| growth path | 2 |" in capsys.readouterr().out


def test_what_lies_outside_is_counted():
    sure = {"row": "age alone", "volume_cm3": 10.0, "low_cm3": 9.0, "high_cm3": 11.0}
    study = ConfidenceStudy(())
    report = study.summarise([sure | {"truth_cm3": one} for one in (9.5, 10.0, 10.5, 12.5)])
    row = report["rows"]["age alone"]
    assert row == {"n": 4, "inside": 0.75, "half": pytest.approx(0.1), "largest": pytest.approx(0.2)}
    assert "| age alone | 4 | 75 % | 10.0 % | 20.0 % |" in study.markdown(report)


def test_only_a_truth_that_is_known_can_be_held_against_it(egg_atlas):
    with pytest.raises(InputError, match="no atlas was given"):
        run(ConfidenceStudy(()))
    with pytest.raises(InputError, match="real truth is not known"):
        run(ConfidenceStudy((egg_atlas,)))
