"""A journal of an evaluation as a killed run, a careless user and another study find it."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from naisr_model.errors import InputError
from naisr_model.work.journal import keeping, plain, read

ROOT = Path(__file__).parents[3]
WHAT = {"program": "1f", "study": "Reach", "atlas": "ab12", "limit": 2}
SAME = json.dumps(WHAT) + "\n"


@pytest.fixture
def path(tmp_path):
    """A journal with two cases."""
    path = tmp_path / "new" / "journal.jsonl"
    assert read(path, WHAT) == {}
    with keeping(path, WHAT) as (_, keep):
        keep("row 1", {"cm3": 0.1 + 0.2, "label": "Größe\n"})
        keep("row 2", {"cm3": math.inf, "parts": [1, None]})
    return path


def test_what_was_kept_is_read(path):
    assert read(path, WHAT) == {
        "row 1": {"cm3": 0.1 + 0.2, "label": "Größe\n"},
        "row 2": {"cm3": math.inf, "parts": [1, None]},
    }


def test_each_case_is_on_the_disk_at_once(path):
    with keeping(path, WHAT) as (_, keep):
        keep("row 3", {})
        assert list(read(path, WHAT)) == ["row 1", "row 2", "row 3"]


@pytest.mark.parametrize("cut", [1, 5, 30])
def test_half_a_line_is_forgotten_and_written_anew(path, cut):
    path.write_bytes(path.read_bytes()[:-cut])
    assert list(read(path, WHAT)) == ["row 1"]
    with keeping(path, WHAT) as (_, keep):
        keep("row 2", {"again": True})
    assert read(path, WHAT)["row 2"] == {"again": True}
    assert path.read_text(encoding="utf-8").count("\n") == 3


def test_a_run_may_be_killed_while_the_first_line_is_written(path):
    path.write_bytes(path.read_bytes()[:20])
    assert read(path, WHAT) == {}
    with keeping(path, WHAT) as (_, keep):
        keep("row 1", {})
    assert read(path, WHAT) == {"row 1": {}}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"program": "2e"}, "keeps a run with another program; name another journal"),
        ({"limit": 3}, r"journal.jsonl keeps a run with another limit; name another journal"),
        ({"limit": 3, "atlas": "cd34"}, "another atlas and another limit"),
        ({"patients": 7}, "keeps something else"),
    ],
)
def test_a_journal_of_something_else_is_refused(path, change, message):
    before = path.read_bytes()
    with pytest.raises(InputError, match=message):
        read(path, {**WHAT, **change})
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    "content",
    ["age,sex\n1,2\n", "[1]\n", "precious", SAME * 2, SAME + '{"foo": 1}\n', '{"program": "1f", "st'],
)
def test_no_other_file_is_taken_for_a_journal(tmp_path, content):
    path = tmp_path / "data.csv"
    path.write_text(content)
    if not content.endswith("\n") and content.startswith('{"program"'):
        assert read(path, WHAT) == {}
        return
    with pytest.raises(InputError, match="no journal; name another file"):
        read(path, WHAT)
    assert path.read_text() == content


HOLD = """
import json, sys, time
from pathlib import Path
from naisr_model.work.journal import keeping
path, what = Path(sys.argv[1]), json.loads(sys.argv[2])
with keeping(path, what) as (_, keep):
    keep("row 3", {})
    print("kept", flush=True)
    time.sleep(600)
"""


def test_a_second_run_is_told_until_the_first_is_killed(path):
    command = [sys.executable, "-c", HOLD, str(path), json.dumps(WHAT)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT) as other:
        try:
            assert other.stdout is not None and other.stdout.readline() == "kept\n"
            told = r"another run keeps .*journal\.jsonl; wait until"
            with pytest.raises(InputError, match=told), keeping(path, WHAT):
                pytest.fail("two at once")
        finally:
            other.kill()
    with keeping(path, WHAT) as (kept, _):
        assert list(kept) == ["row 1", "row 2", "row 3"]


def test_a_run_that_fails_lets_go(path):
    with pytest.raises(ValueError, match="measured wrongly"), keeping(path, WHAT):
        raise ValueError("measured wrongly")
    with keeping(path, WHAT) as (kept, _):
        assert list(kept) == ["row 1", "row 2"]


def test_a_record_is_plain_whether_it_was_kept_or_not(path):
    record: dict[Any, Any] = {"pair": (1.0, 2), 3: "three"}
    with keeping(path, WHAT) as (_, keep):
        keep("row 9", record)
    assert read(path, WHAT)["row 9"] == plain(record) == {"pair": [1.0, 2], "3": "three"}
