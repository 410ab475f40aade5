"""What stands after an option is refused at once where it cannot be meant."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from eggs import untrained

from naisr_model import cli
from naisr_model.checkpoint import save
from naisr_model.cli.options import seconds
from naisr_model.errors import InputError


@pytest.fixture
def atlas(tmp_path, monkeypatch) -> Path:
    """A small atlas in the folder where the commands run."""
    monkeypatch.chdir(tmp_path)
    save(tmp_path / "a.safetensors", untrained())
    return tmp_path / "a.safetensors"


REFUSED = [
    ("mesh a.safetensors x.stl --resolution 12.5", "'12.5' is no whole number"),
    ("mesh a.safetensors x.stl --resolution 1_6", "'1_6' is no whole number"),
    ("mesh a.safetensors x.stl --resolution 0x10", "'0x10' is no whole number"),
    ("mesh a.safetensors x.stl --resolution 100000", "give a multiple of 8 from 16 to 1024"),
    ("mesh a.safetensors x.stl --resolution -8", "give a multiple of 8 from 16 to 1024"),
    ("mesh a.safetensors x.stl --resolution 20", "give a multiple of 8 from 16 to 1024"),
    ("mesh a.safetensors x.stl --set age=5 --set age=6", "'age' is given twice after --set; give it once"),
    ("mesh a.safetensors x.stl --set age=5,age=6", "'age' is given twice after --set; give it once"),
    ("mesh a.safetensors x.stl --set age", "write NAME=VALUE with one of age, sex"),
    ("mesh a.safetensors .", "is a folder; give the name of a file to write"),
    ("fit nowhere.stl --atlas a.safetensors --known age=1,age=2", "'age' is given twice after --known"),
    ("fit nowhere.stl --atlas a.safetensors --known age=99", "trained on 1 to 9 years; give a value within"),
    ("fit nowhere.stl --atlas a.safetensors --scale nan", "'nan' is no finite number"),
    ("fit nowhere.stl --atlas a.safetensors --scale 1e400", "'1e400' is no finite number"),
    ("fit nowhere.stl --atlas a.safetensors --json .", "is a folder; give the name of a file"),
    ("fit nowhere.stl --atlas a.safetensors --out a.safetensors", "is a file; give the name of a folder"),
    ("transfer nowhere.stl --atlas a.safetensors --to age=99", "trained on 1 to 9 years"),
    ("transfer nowhere.stl --atlas a.safetensors --to age=2,age=3", "'age' is given twice after --to"),
    ("transfer nowhere.stl --atlas a.safetensors --to age", "'age' after --to is not understood"),
    ("evolve nowhere.stl --atlas a.safetensors --steps 2.7", "'2.7' is no whole number"),
    ("evolve nowhere.stl --atlas a.safetensors --steps 0", "--steps is 0; give 1 to 1000"),
    ("evolve nowhere.stl --atlas a.safetensors --steps 1000000000", "give 1 to 1000"),
    ("evolve nowhere.stl --atlas a.safetensors --to 99", "trained on 1 to 9 years"),
    ("evolve nowhere.stl --atlas a.safetensors --from -3", "trained on 1 to 9 years"),
    ("evolve nowhere.stl --atlas a.safetensors --to inf", "'inf' is no finite number"),
    ("evolve nowhere.stl --atlas a.safetensors --path nowhere.csv", "nowhere.csv cannot be read"),
    ("prepare nowhere.csv --out x --surface-samples 1000000000", "give at least 1, at most 10000000"),
    ("prepare nowhere.csv --out x --seed -1", "the seed is -1; give 0 or more"),
    ("prepare nowhere.csv --out x --held-out 1", "give a number from 0 to below 1"),
    ("prepare nowhere.csv --out a.safetensors", "is a file; give the name of a folder"),
    ("populate airway x --patients 1000000000", "give at least 1, at most 100000"),
    ("populate airway x --patients 2.5", "'2.5' is no whole number"),
    ("populate airway x --seed -1", "the seed is -1; give 0 or more"),
    ("train nowhere --out .", "is a folder; give the name of a file"),
    ("train nowhere --out x.safetensors --epochs 1.5", "'1.5' is no whole number"),
    ("evaluate calibration a.safetensors --patients 1000000000", "give 1 or more, up to 50000"),
    ("evaluate fitting a.safetensors --steps 2.5", "'2.5' is no whole number"),
    ("evaluate fitting a.safetensors --journal .", "is a folder; give the name of a file"),
]


@pytest.mark.parametrize(("line", "message"), REFUSED)
def test_what_cannot_be_meant_is_refused_at_once(atlas, capsys, line, message):
    assert cli.main(line.split()) == 2
    told = capsys.readouterr().err
    assert message in told and told.count("\n") == 1
    assert [path.name for path in Path().iterdir()] == ["a.safetensors"]


@pytest.mark.parametrize(
    ("setting", "low"), [("--epochs", 1), ("--epochs", 0), ("--epochs", -1), ("--seed", -1), ("--seed", 0)]
)
def test_settings_after_options_have_their_ranges(egg_store, tmp_path, capsys, setting, low):
    name = setting.removeprefix("--")
    words = ["train", str(egg_store.path), "--out", str(tmp_path / "a.safetensors"), "--device", "abacus"]
    assert cli.main([*words, f"{setting}={low}"]) == 2
    told = capsys.readouterr().err
    is_allowed = low >= {"epochs": 1, "seed": 0}[name]
    wanted = "cannot compute on 'abacus'" if is_allowed else f"the setting 'training.{name}' is {low}; give"
    assert wanted in told and told.count("\n") == 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("age,age\n1,2\n", "the column 'age' twice; rename one"),
        ("age,sex\n1\n", "row 2 has 1 cells, the header has 2"),
        ("age\n3\n99\n", "trained on 1 to 9 years"),
        ("age\n", "has no rows"),
        ("", "has no rows"),
        ("height\n3\n", "unknown covariate 'height'"),
        ("age\n" + "3\n" * 1001, "has 1001 rows; give 1 to 1000"),
    ],
)
def test_a_table_of_the_way_is_checked_before_the_fit(atlas, tmp_path, capsys, text, message):
    (tmp_path / "way.csv").write_text(text)
    assert cli.main(["evolve", "nowhere.stl", "--atlas", "a.safetensors", "--path", "way.csv"]) == 2
    assert re.search(message, capsys.readouterr().err)


def test_a_journal_with_other_records_is_told(egg_atlas, egg_store, tmp_path, capsys):
    journal = tmp_path / "journal.jsonl"
    words = ["evaluate", "completion", str(egg_atlas), "--store", str(egg_store.path)]
    words += ["--journal", str(journal), "--limit", "1"]
    assert cli.main(words) == 0
    first, *cases = journal.read_text().splitlines()
    emptied = [json.dumps(json.loads(case) | {"record": {}}) for case in cases]
    journal.write_text("\n".join([first, *emptied]) + "\n")
    capsys.readouterr()
    assert cli.main(words) == 2
    assert "keeps what this evaluation never measured" in capsys.readouterr().err
    journal.write_text("[" * 100_000 + "\n")
    assert cli.main(words) == 2
    assert "is no journal" in capsys.readouterr().err


@pytest.mark.parametrize("text", ["", "s", "-3s", "nans", "infh", "1e400h", "3", "3d", "3 m s"])
def test_a_time_that_is_none_is_refused(text):
    with pytest.raises(InputError, match=r"write it as 90s, 45m or 1\.5h"):
        seconds(text)
