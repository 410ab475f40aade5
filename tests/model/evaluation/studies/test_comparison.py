"""Atlases of one population beside each other."""

from __future__ import annotations

import json
import shutil

import pytest
from eggs import moved_as_in

from naisr_model import cli
from naisr_model.checkpoint import load, save
from naisr_model.errors import InputError
from naisr_model.evaluation import truth
from naisr_model.evaluation.studies.comparison import Comparison
from naisr_model.evaluation.study import identity, run


@pytest.mark.usefixtures("coarse")
def test_every_model_has_a_row_and_what_it_cannot_do_a_dash(egg_people, tmp_path, monkeypatch):
    monkeypatch.setattr(truth, "EFFECT_VALUES", 2)
    other = tmp_path / "flowing.safetensors"
    save(other, moved_as_in("ndf", egg_people.atlas))
    study = Comparison((egg_people.atlas, other), limit=1)
    report = run(study, journal=tmp_path / "journal")
    naisr, ndf = report["atlases"]
    assert naisr["weights"] == sum(weight.numel() for weight in load(egg_people.atlas).weights.values())
    training = load(egg_people.atlas)
    drawn = training.preset.training.batch_shapes * training.preset.training.shape_points
    assert naisr["points"] == training.training["iterations"] * drawn
    assert set(naisr["fit_s"]) == {"given", "inferred"} and set(ndf["fit_s"]) == {"given"}
    assert ndf["report"]["cd_x100"]["mean"] > naisr["report"]["cd_x100"]["mean"]  # its motions are random
    text = study.markdown(json.loads(json.dumps(report)))
    of_ndf = [line for line in text.splitlines() if line.startswith("| NDF (flowing)")]
    assert "no covariates" in of_ndf[0] and of_ndf[1].count("–") == 4
    (growth,) = {line for line in text.splitlines() if line.startswith("| NAISR") and " %, " in line}
    worst = max(abs(error) for error in naisr["report"]["truth_volume_error"].values())
    assert f"/ {100 * worst:.1f} %" in growth
    for block in text.split("\n\n"):
        rows = [line for line in block.splitlines() if line.startswith("|")]
        assert len({row.count("|") for row in rows}) <= 1


@pytest.mark.usefixtures("coarse")
def test_the_command_takes_several_files_and_the_store(egg_atlas, egg_asdf, egg_store, tmp_path, capsys):
    target = tmp_path / "figures.json"
    words = ["evaluate", "comparison", str(egg_atlas), str(egg_asdf), "--store", str(egg_store.path)]
    assert cli.main([*words, "--limit", "1", "--json", str(target)]) == 0
    told = capsys.readouterr().out
    assert "| A-SDF (eggs), covariates inferred, 1 shapes" in told and "growth path" not in told
    assert [one["label"] for one in json.loads(target.read_text())["atlases"]] == [
        "NAISR (eggs)",
        "A-SDF (eggs)",
    ]


def test_atlases_of_other_people_and_a_single_one_are_refused(egg_atlas, egg_people, tmp_path):
    with pytest.raises(InputError, match="1 atlas was given; a comparison needs two or more"):
        Comparison((egg_people.atlas,)).cases()
    with pytest.raises(InputError, match=r"not trained on the people of .*; compare atlases of one store"):
        Comparison((egg_people.atlas, egg_atlas)).cases()
    copy = tmp_path / "b.safetensors"
    shutil.copy(egg_people.atlas, copy)
    before = identity(Comparison((egg_people.atlas, copy)))
    assert before["atlases"][0] == before["atlases"][1]
    shutil.copy(egg_atlas, copy)
    assert identity(Comparison((egg_people.atlas, copy)))["atlases"][1] != before["atlases"][1]
