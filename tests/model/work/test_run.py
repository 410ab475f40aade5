"""Jobs over processes: the same results as in one, and what becomes of them when somebody stops or dies."""

from __future__ import annotations

import doctest
import math
import os
import subprocess
import sys
import time
from concurrent import futures
from pathlib import Path

import pytest

from naisr_model.errors import Cancelled, InputError
from naisr_model.progress import Progress
from naisr_model.work import run
from naisr_model.work.run import cores, in_order, processes


@pytest.mark.parametrize("workers", [1, 2])
def test_results_come_with_the_number_of_their_job(workers):
    told: list[float] = []
    with processes(workers) as work:
        results = list(work(math.sqrt, [9.0, 4.0, 1.0], Progress(told.append)))
        assert sorted(results) == [(0, 3.0), (1, 2.0), (2, 1.0)]
        assert in_order(work(abs, [-3, 5])) == [3, 5]
    assert told == sorted(told) and told[-1] == pytest.approx(1.0)


def test_one_worker_stays_in_this_process_and_two_do_not():
    for workers in (1, 2):
        with processes(workers) as work:
            ((_, value),) = work(eval, ["__import__('os').getpid()"])
        assert (value == os.getpid()) is (workers == 1)


def test_a_worker_has_one_thread():
    with processes(2) as work:
        assert in_order(work(os.getenv, ["OMP_NUM_THREADS"])) == ["1"]
        assert in_order(work(eval, ["__import__('torch').get_num_threads()"])) == [1]


def test_the_ctrl_c_of_a_terminal_is_left_to_the_parent():
    with processes(2) as work:
        assert in_order(work(eval, ["__import__('os').kill(__import__('os').getpid(), 2)", "3"])) == [None, 3]


def test_the_ctrl_c_of_a_terminal_while_workers_start_is_the_parents_too():
    """In a process group of its own, as a terminal gives one to a command; at the first look at who waits,
    right after the jobs went out: an interpreter takes longer than that to be ready."""
    program = (
        "import os, signal\n"
        "from naisr_model.progress import Progress\n"
        "from naisr_model.work.run import processes\n"
        "came, calls = [], []\n"
        "signal.signal(signal.SIGINT, lambda *_: came.append(1))\n"
        "def unwanted():\n"
        "    calls.append(1)\n"
        "    if len(calls) == 1: os.killpg(0, signal.SIGINT)\n"
        "with processes(2) as work: print(sorted(work(abs, [-2, 3], Progress(is_unwanted=unwanted))))\n"
        "print(came)"
    )
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, capture_output=True, text=True, check=True, start_new_session=True)
    assert done.stderr == "" and done.stdout == "[(0, 2), (1, 3)]\n[1]\n"


def test_a_result_is_there_before_the_other_jobs_are_done():
    with processes(2) as work:
        results = work(time.sleep, [60.0, 0.0])
        assert next(results)[0] == 1
        pid = in_order(work(eval, ["__import__('os').getpid()"]))[0]
        assert pid != os.getpid()
        os.kill(pid, 9)
        with pytest.raises(InputError, match="run again with fewer workers"):
            list(results)


def test_a_worker_that_was_killed_ends_the_work_with_a_sentence():
    with pytest.raises(InputError, match="run again with fewer workers"), processes(2) as work:
        list(work(eval, ["1", "__import__('os').kill(__import__('os').getpid(), 9)", "2", "3"]))


@pytest.mark.parametrize("workers", [1, 2])
def test_a_mistake_in_a_job_is_raised_here(workers):
    with processes(workers) as work, pytest.raises(ValueError, match=r"math domain|nonnegative"):
        list(work(math.sqrt, [4.0, -1.0]))


def test_what_is_finished_together_with_a_mistake_is_not_lost(monkeypatch):
    monkeypatch.setattr(run, "wait", lambda pending, **_: futures.wait(pending))
    found = []
    with processes(2) as work, pytest.raises(ValueError, match=r"math domain|nonnegative"):
        for result in work(math.sqrt, [-1.0, 4.0, 9.0]):
            found.append(result)
    assert found == [(1, 2.0), (2, 3.0)]


@pytest.mark.parametrize("workers", [1, 2])
def test_nobody_waits_any_more(workers):
    finished: list[int] = []
    two_are_enough = Progress(is_unwanted=lambda: len(finished) >= 2)
    with pytest.raises(Cancelled), processes(workers) as work:
        for number, _ in work(abs, range(1000), two_are_enough):
            finished.append(number)
    assert 2 <= len(finished) < 1000


def test_what_is_still_at_work_is_given_up():
    with pytest.raises(Cancelled), processes(2) as work:
        for _ in work(time.sleep, [0.0, 3600.0]):
            raise Cancelled


def test_a_number_of_workers_that_makes_no_sense():
    for count in (0, -1, 99_999_999_999):
        with (
            pytest.raises(InputError, match=f"the number of workers is {count}; give 1 to"),
            processes(count),
        ):
            pass
    assert cores() >= 1


def test_a_machine_with_more_cores_than_there_can_be_workers(monkeypatch):
    monkeypatch.setattr(run, "cores", lambda: 500)
    with processes() as work:
        assert in_order(work(abs, [-2])) == [2]


def test_the_example_in_the_documentation():
    assert doctest.testmod(run).failed == 0


UNGUARDED = """
import math
from naisr_model.errors import InputError
from naisr_model.work.run import in_order, processes

try:
    with processes(2) as work:
        in_order(work(math.sqrt, [9.0]))
except InputError as error:
    print(error)
"""


def test_a_script_without_a_main_guard_is_told_so(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(UNGUARDED)
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[3])}
    done = subprocess.run(
        [sys.executable, str(script)], env=environment, capture_output=True, text=True, check=False
    )
    assert "if __name__ == '__main__'; write it so, or run with one worker" in done.stdout
    assert "memory" not in done.stdout and done.stderr == ""
