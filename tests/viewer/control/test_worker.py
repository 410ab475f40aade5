"""The newest job wins, nothing queues up, stale results are dropped, no thread survives."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from threading import Event

import pytest
from pytestqt.qtbot import QtBot

from naisr_model.progress import Progress
from naisr_viewer.control.worker import Worker


@pytest.fixture
def worker(qtbot: QtBot) -> Iterator[Worker]:
    worker = Worker()
    yield worker
    worker.close()


@pytest.fixture
def heard() -> list[object]:
    return []


PATIENCE_S = 60.0


class Gate:
    """A job that delivers its name once it is let through, and polls while it waits."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.started, self.open, self.stopped = Event(), Event(), Event()

    def __call__(self, deliver, progress: Progress) -> None:
        self.started.set()
        while not self.open.wait(0.002):
            if progress.is_unwanted():
                self.stopped.set()
                break
        deliver(self.name)


def test_a_result_arrives_on_the_thread_of_the_window(qtbot, worker):
    threads: list[threading.Thread] = []
    with qtbot.waitSignal(worker.idle):
        worker.submit(
            lambda deliver, progress: deliver(threading.current_thread()),
            lambda _: threads.append(threading.current_thread()),
        )
    assert threads == [threading.main_thread()]


def test_a_stream_of_jobs_leaves_no_queue(qtbot, worker, heard):
    first = Gate("first")
    worker.submit(first, heard.append)
    assert first.started.wait(PATIENCE_S)
    ran: list[int] = []
    for number in range(100):
        worker.submit(lambda deliver, progress, number=number: ran.append(number), heard.append)
    with qtbot.waitSignal(worker.idle):
        first.open.set()
    assert ran == [99]
    assert heard == ["first"]  # it was not cancelled, so a drag does not starve


def test_cancelling_stops_the_running_job_and_drops_what_it_still_says(qtbot, worker, heard):
    stale, fresh = Gate("stale"), Gate("fresh")
    fresh.open.set()
    worker.submit(stale, heard.append)
    assert stale.started.wait(PATIENCE_S)
    worker.cancel()
    with qtbot.waitSignal(worker.idle):
        worker.submit(fresh, heard.append)
    assert stale.stopped.is_set()
    assert heard == ["fresh"]


def test_cancelling_forgets_the_waiting_job_and_says_when_it_is_idle(qtbot, worker, heard):
    running, waiting = Gate("running"), Gate("waiting")
    worker.submit(running, heard.append)
    assert running.started.wait(PATIENCE_S)
    worker.submit(waiting, heard.append)
    with qtbot.waitSignal(worker.idle):
        worker.cancel()
    assert not waiting.started.is_set()
    assert heard == []


def test_an_error_is_handed_over_and_the_worker_lives_on(qtbot, worker, heard):
    def fail(deliver, progress):
        raise ValueError("no such thing")

    with qtbot.waitSignal(worker.failed) as caught:
        worker.submit(fail, heard.append)
    assert str(caught.args[0]) == "no such thing"
    with qtbot.waitSignal(worker.idle):
        worker.submit(lambda deliver, progress: deliver(1), heard.append)
    assert heard == [1]


def test_closing_ends_the_thread_even_in_the_middle_of_a_job(qtbot):
    worker = Worker()
    heard: list[object] = []
    gate = Gate("late")
    worker.submit(gate, heard.append)
    assert gate.started.wait(PATIENCE_S)
    worker.close()
    worker.submit(gate, heard.append)
    qtbot.wait(20)
    assert heard == []
    assert not [thread for thread in threading.enumerate() if thread.name == "naisr-worker"]


def test_synchronous_mode_is_done_when_submit_returns(qtbot):
    worker = Worker(synchronous=True)
    heard: list[object] = []
    worker.submit(lambda deliver, progress: deliver("at once"), heard.append)
    assert heard == ["at once"]


def test_cancelling_what_has_not_begun_ends_in_idleness(qtbot, worker, heard):
    """Whoever gets there first, the thread that takes the job or the one that cancels it."""
    for _ in range(50):
        with qtbot.waitSignal(worker.idle, timeout=30_000):
            worker.submit(lambda deliver, progress: deliver("late"), heard.append)
            worker.cancel()
    assert heard == []


def test_each_result_goes_to_whoever_asked_for_it(qtbot, worker):
    first: list[str] = []
    second: list[str] = []
    with qtbot.waitSignal(worker.idle):
        worker.submit(lambda deliver, progress: deliver("mine"), first.append)
    with qtbot.waitSignal(worker.idle):
        worker.submit(lambda deliver, progress: deliver("yours"), second.append)
    assert (first, second) == (["mine"], ["yours"])
