"""The commands that are made of the studies."""

from __future__ import annotations

import dataclasses
import re

import pytest

from naisr_model import cli
from naisr_model.evaluation.studies import STUDIES


@pytest.mark.parametrize("name", STUDIES)
def test_every_study_is_a_command_that_says_what_its_options_mean(name, capsys):
    assert cli.main(["evaluate", name, "--help"]) == 0
    told = " ".join(capsys.readouterr().out.replace("\u2502", " ").split())
    for option in dataclasses.fields(STUDIES[name]):
        assert f"--{option.name}" in told
    for words in (
        "the .safetensors file",
        "--journal PATH keep what is measured in this file",
        "--workers INT processes",
        "--json PATH also write the figures to this file",
    ):
        assert words in told
    if "store" in STUDIES[name].__dataclass_fields__:
        assert (
            re.search("--store PATH where (its|their) held-out shapes are", told)
            and "--limit INT at most" in told
        )


def test_all_of_them_are_listed(capsys):
    assert cli.main(["evaluate", "--help"]) == 0
    told = capsys.readouterr().out
    assert all(name in told for name in STUDIES)


def test_a_journal_of_another_evaluation_is_refused(egg_atlas, egg_store, tmp_path, capsys):
    journal = tmp_path / "journal.jsonl"
    words = ["evaluate", "completion", str(egg_atlas), "--store", str(egg_store.path)]
    given = ["--journal", str(journal), "--limit"]
    assert cli.main([*words, *given, "1"]) == 0
    kept = journal.read_bytes()
    assert cli.main([*words, *given, "2"]) == 2
    assert "keeps a run with another limit; name another journal" in capsys.readouterr().err
    assert cli.main([*words, "--limit", "1", "--workers", "0"]) == 2
    assert "the number of workers is 0" in capsys.readouterr().err
    assert journal.read_bytes() == kept


def test_the_journal_is_not_replaced_by_the_report(egg_atlas, egg_store, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = ["evaluate", "completion", str(egg_atlas), "--store", str(egg_store.path)]
    assert cli.main([*words, "--journal", "both.jsonl", "--json", str(tmp_path / "both.jsonl")]) == 2
    assert "name two files" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
