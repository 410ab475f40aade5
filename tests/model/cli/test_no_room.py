"""Every command that writes, where the disk is full: a sentence, nothing half written, and nothing lost."""

from __future__ import annotations

import io
import json
import sys
from pathlib import Path

import pytest
from eggs import egg, saved

from naisr_model import cli

LEAST = 100
"""Bytes that still find room; no file of ours is as short."""

FIT = ["SCAN", "--atlas", "ATLAS", "--known", "age=6,sex=M"]
STUDY = ["ATLAS", "--store", "STORE", "--limit", "2"]
COMMANDS = {
    "mesh": ["mesh", "ATLAS", "OUT/mean.ply", "--resolution", "16"],
    "fit's figures": ["fit", *FIT, "--json", "OUT/fit.json"],
    "fit's folder": ["fit", *FIT, "--out", "OUT/fit"],
    "evolve": ["evolve", *FIT, "--steps", "2", "--out", "OUT/years"],
    "transfer": ["transfer", *FIT, "--to", "age=8", "--json", "OUT/there.json"],
    "measure": ["measure", "ATLAS", "--json", "OUT/measures.json"],
    "a study's report": ["evaluate", "completion", *STUDY, "--json", "OUT/report.json"],
    "a study's journal": ["evaluate", "completion", *STUDY, "--journal", "OUT/journal.jsonl"],
    "prepare": ["prepare", "TABLE", "--out", "OUT/store", "--workers", "1"],
    "train": ["train", "STORE", "--out", "OUT/mine.safetensors", "--preset", "demo", "--epochs", "1"],
    "populate": ["populate", "airway", "OUT/people", "--patients", "1"],
}
FIGURES = {
    "fit's figures": "volume: ",
    "fit's folder": "volume: ",
    "evolve": " cm³ (",
    "transfer": " cm³ (",
    "measure": "Volume",
    "a study's report": "|",
}
"""What these commands have found out is told all the same."""

LOGS = ("journal.jsonl", "mine.safetensors.training/tensorboard/events.out.tfevents.")
"""Files that grow line by line: who reads them leaves out a half one."""


def files(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("what", COMMANDS)
def test_a_command_that_finds_no_room(what, egg_atlas, egg_store, egg_table, tmp_path, no_room, capsys):
    out = tmp_path / "out"
    out.mkdir()
    places = {"ATLAS": egg_atlas, "STORE": egg_store.path, "TABLE": egg_table, "OUT": out}
    places["SCAN"] = saved(egg(6.0, 1.0), tmp_path / "egg.stl")
    words = list(COMMANDS[what])
    for name, path in places.items():
        words = [word.replace(name, str(path)) for word in words]
    with no_room(LEAST):
        assert cli.main(words) == 2
    told = capsys.readouterr()
    assert f"naisr: cannot write {out}" in told.err and "File too large; " in told.err
    assert "Traceback" not in told.err and told.err.count("naisr: cannot write") == 1
    assert FIGURES.get(what, "") in told.out
    whole = {name for name, content in files(out).items() if content}
    assert {name for name in whole if not name.startswith(LOGS)} == set()
    assert [name for name in files(out) if Path(name).name.startswith(".")] == []


class Deaf(io.StringIO):
    """Nobody listens any more."""

    def write(self, _text: str) -> int:
        raise BrokenPipeError


def test_figures_are_in_their_file_where_nobody_listens(egg_atlas, tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "stdout", Deaf())
    words = ["fit", saved(egg(6.0, 1.0), tmp_path / "egg.stl"), "--atlas", egg_atlas, *FIT[3:]]
    cli.main([*map(str, words), "--json", str(tmp_path / "fit.json"), "--out", str(tmp_path / "fit")])
    assert json.loads((tmp_path / "fit.json").read_text())["volume_cm3"] > 0
    assert (tmp_path / "fit" / "volumes.csv").exists()
