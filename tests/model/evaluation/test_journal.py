"""A journal of an evaluation as a killed run, a careless user and another study find it."""

from __future__ import annotations

import math
from typing import Any

import pytest

from naisr_model.errors import InputError
from naisr_model.evaluation.journal import keeping, plain, read

WHAT = {"version": "1", "study": "Reach", "atlas": "ab12", "limit": 2}


@pytest.fixture
def path(tmp_path):
    """A journal with two cases."""
    path = tmp_path / "new" / "journal.jsonl"
    assert read(path, WHAT) == {}
    with keeping(path, WHAT) as keep:
        keep("row 1", {"cm3": 0.1 + 0.2, "label": "Größe\n"})
        keep("row 2", {"cm3": math.inf, "parts": [1, None]})
    return path


def test_what_was_kept_is_read(path):
    assert read(path, WHAT) == {
        "row 1": {"cm3": 0.1 + 0.2, "label": "Größe\n"},
        "row 2": {"cm3": math.inf, "parts": [1, None]},
    }


def test_each_case_is_on_the_disk_at_once(path):
    with keeping(path, WHAT) as keep:
        keep("row 3", {})
        assert list(read(path, WHAT)) == ["row 1", "row 2", "row 3"]


@pytest.mark.parametrize("cut", [1, 5, 30])
def test_half_a_line_is_forgotten_and_written_anew(path, cut):
    path.write_bytes(path.read_bytes()[:-cut])
    assert list(read(path, WHAT)) == ["row 1"]
    with keeping(path, WHAT) as keep:
        keep("row 2", {"again": True})
    assert read(path, WHAT)["row 2"] == {"again": True}
    assert path.read_text(encoding="utf-8").count("\n") == 3


def test_a_run_may_be_killed_while_the_first_line_is_written(path):
    path.write_bytes(path.read_bytes()[:20])
    assert read(path, WHAT) == {}
    with keeping(path, WHAT) as keep:
        keep("row 1", {})
    assert read(path, WHAT) == {"row 1": {}}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"limit": 3}, r"journal.jsonl keeps an evaluation with another limit; name another journal"),
        ({"limit": 3, "atlas": "cd34"}, "another atlas and another limit"),
        ({"patients": 7}, "keeps something else"),
    ],
)
def test_a_journal_of_something_else_is_refused(path, change, message):
    before = path.read_bytes()
    with pytest.raises(InputError, match=message):
        read(path, {**WHAT, **change})
    assert path.read_bytes() == before


@pytest.mark.parametrize("content", ["age,sex\n1,2\n", "[1]\n", "precious", '{"version": "1", "st'])
def test_no_other_file_is_taken_for_a_journal(tmp_path, content):
    path = tmp_path / "data.csv"
    path.write_text(content)
    if content.startswith('{"version"'):
        assert read(path, WHAT) == {}
        return
    with pytest.raises(InputError, match="no journal of an evaluation; name another file"):
        read(path, WHAT)
    assert path.read_text() == content


def test_a_record_is_plain_whether_it_was_kept_or_not(path):
    record: dict[Any, Any] = {"pair": (1.0, 2), 3: "three"}
    with keeping(path, WHAT) as keep:
        keep("row 9", record)
    assert read(path, WHAT)["row 9"] == plain(record) == {"pair": [1.0, 2], "3": "three"}
