"""A study from its cases to its report: killed and started again, over processes, with a journal."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest

from naisr_model.data.store import INDEX
from naisr_model.errors import Cancelled, InputError
from naisr_model.evaluation.studies.completion import Completion
from naisr_model.evaluation.study import identity, run
from naisr_model.files import sources_digest
from naisr_model.progress import SILENT, Progress

ROOT = Path(__file__).parents[3]


@dataclass(frozen=True)
class Number:
    """A case."""

    value: int

    @property
    def key(self) -> str:
        """Its name."""
        return f"number {self.value}"


@dataclass(frozen=True)
class Squares:
    """A study that writes down what it measures."""

    atlas: Path
    log: str
    numbers: int = 4

    def cases(self) -> list[Number]:
        return [Number(value) for value in reversed(range(self.numbers))]

    def measure(self, case: Number, progress: Progress = SILENT) -> dict[str, Any]:
        progress.check()
        with Path(self.log).open("a") as file:
            file.write(f"{case.value} ")
        return {"square": (case.value**2,)}

    def summarise(self, records: Sequence[dict[str, Any]]) -> dict[str, Any]:
        return {"squares": [record["square"] for record in records]}

    def markdown(self, report: Mapping[str, Any]) -> str:
        return str(report)


@pytest.fixture
def squares(tmp_path) -> Squares:
    (tmp_path / "atlas").write_text("some atlas")
    return Squares(tmp_path / "atlas", str(tmp_path / "log"))


def measured(study: Squares) -> str:
    return Path(study.log).read_text().strip()


def test_records_come_in_the_order_of_the_cases_and_as_plain_json(squares):
    told: list[float] = []
    assert run(squares, progress=Progress(told.append)) == {"squares": [[9], [4], [1], [0]]}
    assert told == sorted(told) and told[-1] == pytest.approx(1.0)


def test_a_stopped_run_goes_on_where_it_was(squares, tmp_path):
    journal = tmp_path / "journal.jsonl"
    two_are_enough = Progress(is_unwanted=lambda: Path(squares.log).exists() and measured(squares) == "3 2")
    with pytest.raises(Cancelled):
        run(squares, journal=journal, progress=two_are_enough)
    told: list[float] = []
    assert run(squares, journal=journal, progress=Progress(told.append)) == run(squares)
    assert measured(squares) == "3 2 1 0 3 2 1 0"
    assert told[0] > 0.5
    assert run(squares, journal=journal) == {"squares": [[9], [4], [1], [0]]}
    assert measured(squares) == "3 2 1 0 3 2 1 0"


def test_a_journal_is_of_one_study_with_one_atlas_and_its_options(squares, tmp_path):
    journal = tmp_path / "journal.jsonl"
    run(squares, journal=journal)
    with pytest.raises(InputError, match="another numbers"):
        run(replace(squares, numbers=5), journal=journal)
    moved = squares.atlas.rename(tmp_path / "moved")
    assert identity(replace(squares, atlas=moved)) == json.loads(journal.read_text().splitlines()[0])
    moved.write_text("another atlas")
    with pytest.raises(InputError, match="a run with another atlas; name another journal"):
        run(replace(squares, atlas=moved), journal=journal)


@dataclass(frozen=True)
class Rewritten(Squares):
    """A study whose file a training rewrites while the second case is measured."""

    def measure(self, case: Number, progress: Progress = SILENT) -> dict[str, Any]:
        if case.value == self.numbers - 2:
            self.atlas.write_text("trained on")
        return super().measure(case, progress)


@pytest.mark.parametrize("workers", [1, 2])
@pytest.mark.parametrize("is_kept", [True, False])
def test_files_that_change_meanwhile_end_it(squares, tmp_path, workers, is_kept):
    journal = tmp_path / "journal.jsonl" if is_kept else None
    study = Rewritten(squares.atlas, squares.log)
    with pytest.raises(
        InputError, match=r"the atlas .*atlas was changed while it was evaluated; give a copy"
    ):
        run(study, workers=workers, journal=journal)
    if journal is not None:
        kept = [json.loads(line)["key"] for line in journal.read_text().splitlines()[1:]]
        # A second process may be done with others while the first is about to rewrite the file.
        assert kept == ["number 3"] if workers == 1 else "number 2" not in kept


def test_a_file_that_changes_between_the_start_and_the_cases_ends_it(squares):
    class Sooner(Squares):
        def cases(self) -> list[Number]:
            self.atlas.unlink()
            return super().cases()

    with pytest.raises(InputError, match=r"the atlas .* was changed"):
        run(Sooner(squares.atlas, squares.log))


def test_the_store_counts_as_well(egg_atlas, egg_store, tmp_path, monkeypatch):
    store = Path(shutil.copytree(egg_store.path, tmp_path / "store"))
    measure = Completion.measure

    def while_somebody_prepares(*arguments: Any) -> dict[str, Any]:
        found = measure(*arguments)
        (store / INDEX).write_text((store / INDEX).read_text() + " ")
        return found

    monkeypatch.setattr(Completion, "measure", lambda *some, progress: while_somebody_prepares(*some))
    with pytest.raises(InputError, match=r"the store .*store was changed while it was evaluated"):
        run(Completion(egg_atlas, store=store, limit=1))


def test_a_journal_is_of_one_program(squares, tmp_path):
    assert identity(squares)["program"] == sources_digest(ROOT / "naisr_model").hex()
    journal = tmp_path / "journal.jsonl"
    run(squares, journal=journal)
    first, *cases = journal.read_text().splitlines()
    other = json.dumps(json.loads(first) | {"program": "of yesterday"})
    journal.write_text("\n".join([other, *cases]) + "\n")
    with pytest.raises(InputError, match="a run with another program; name another journal"):
        run(squares, journal=journal)


def test_nothing_to_measure_is_said(squares):
    with pytest.raises(InputError, match="nothing to measure with these options"):
        run(replace(squares, numbers=0))


def test_two_cases_of_one_key_are_a_mistake(squares):
    class Twice(Squares):
        def cases(self) -> list[Number]:
            return [Number(1), Number(1)]

    with pytest.raises(ValueError, match="the same key"):
        run(Twice(squares.atlas, squares.log))


@pytest.fixture(scope="module")
def study(egg_atlas, egg_store) -> Completion:
    """A real study of three eggs."""
    return Completion(egg_atlas, store=egg_store.path, limit=3)


@pytest.fixture(scope="module")
def report(study) -> dict[str, Any]:
    """What an uninterrupted run in one process gives."""
    return run(study)


def complete_lines(journal: Path) -> list[str]:
    lines = journal.read_text().splitlines(keepends=True) if journal.exists() else []
    return [line for line in lines if line.endswith("\n")]


PROGRAM = """
import os, signal, sys
from naisr_model.cli import main
from naisr_model.evaluation.studies.completion import Completion

measure, measured = Completion.measure, []


def measure_or_kill(self, case, **options):
    if len(measured) == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    measured.append(case)
    return measure(self, case, **options)


Completion.measure = measure_or_kill
main(sys.argv[1:])
"""
"""Kills itself once one of its cases is in the journal."""


@pytest.mark.skipif(sys.platform == "win32", reason="there is no SIGKILL")
def test_a_killed_run_goes_on_to_the_same_report(study, report, tmp_path):
    journal = tmp_path / "journal.jsonl"
    command = [sys.executable, "-c", PROGRAM, "evaluate", "completion", str(study.atlas)]
    options = ["--store", str(study.store), "--limit", "3", "--journal", str(journal)]
    environment = os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    killed = subprocess.run([*command, *options], env=environment, check=False)
    assert killed.returncode == -signal.SIGKILL
    done = complete_lines(journal)
    assert len(done) == 2  # what it is about, and a case
    assert run(study, journal=journal) == report
    after = complete_lines(journal)
    assert after[: len(done)] == done
    keys = [json.loads(line)["key"] for line in after[1:]]
    assert sorted(keys) == sorted(case.key for case in study.cases())


def test_a_cluster_gives_the_report_of_one_process(study, report):
    pytest.importorskip("distributed", reason="the extra 'cluster' is not installed")
    assert run(study, cluster="local:1") == report
    with pytest.raises(InputError, match="--workers are processes on this machine"):
        run(study, workers=2, cluster="local:1")


def test_two_processes_give_the_report_of_one(study, report, tmp_path):
    journal = tmp_path / "journal.jsonl"
    assert run(study, workers=2, journal=journal) == report
    assert run(study, journal=journal) == report
