"""``naisr measure`` as a user types it."""

from __future__ import annotations

import json

import numpy as np
import pytest
from eggs import egg, saved

from naisr_model import cli

TRUE_CM3 = 4 / 3 * np.pi * 22 * 20 * 32 / 1000
"""Of the egg of six years, M."""


@pytest.fixture(autouse=True)
def coarse(monkeypatch):
    monkeypatch.setattr("naisr_model.measures.curves.COARSE", 32)


@pytest.fixture
def measure(capsys, egg_atlas):
    def run(*words):
        code = cli.main(["measure", str(egg_atlas), *map(str, words)])
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return run


def test_the_average_with_what_people_have(measure, tmp_path):
    code, out, _ = measure("--set", "age=6,sex=M", "--json", tmp_path / "m.json")
    record = json.loads((tmp_path / "m.json").read_text())
    volume = record["measures"]["volume"]
    assert code == 0 and "Volume" in out and "cm³" in out and "people: 6 years, M" in out
    assert volume["value"] == pytest.approx(TRUE_CM3, rel=0.05) and volume["unit"] == "cm³"
    assert volume["low"] < volume["median"] < volume["high"]
    assert "percentile" not in out and "sections" not in record


def test_a_patient_larger_than_most_stands_above_them(measure, tmp_path):
    scan = saved(egg(6.0, 1.0).apply_scale(1.02), tmp_path / "large.stl")
    words = ["--scan", scan, "--set", "age=6", "--set", "sex=M", "--json", tmp_path / "m.json"]
    code, out, _ = measure(*words)
    volume = json.loads((tmp_path / "m.json").read_text())["measures"]["volume"]
    assert code == 0 and "percentile" in out and "of the surface" in out and "mm from the scan" in out
    assert volume["percentile"] > 50 and volume["z"] > 0


def test_what_was_inferred_is_told(measure, tmp_path):
    code, out, _ = measure("--scan", saved(egg(6.0, 1.0), tmp_path / "egg.stl"), "--set", "sex=M")
    assert code == 0 and "inferred from the scan itself: age" in out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--set", "age=99"], "the atlas was trained on 1 to"),
        (["--set", "size=9"], "NAME=VALUE with one of age, sex"),
        (["--scan", "nowhere.stl"], "nowhere.stl"),
        (["--align", "icp"], "add --scan FILE"),
    ],
)
def test_bad_input_gets_one_sentence(measure, words, message):
    code, _, error = measure(*words)
    assert code == 2 and message in error


def test_a_model_without_a_template_is_refused(capsys, egg_deepsdf):
    assert cli.main(["measure", str(egg_deepsdf)]) == 2
    assert "deforms no template" in capsys.readouterr().err
