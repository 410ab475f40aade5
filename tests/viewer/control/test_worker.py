"""The newest job wins, nothing queues up, stale results are dropped, no thread survives."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from threading import Event

import pytest
from pytestqt.qtbot import QtBot

from naisr_viewer.control.worker import Worker


@pytest.fixture
def worker(qtbot: QtBot) -> Iterator[Worker]:
    worker = Worker()
    yield worker
    worker.close()


@pytest.fixture
def heard(worker: Worker) -> list[object]:
    items: list[object] = []
    worker.delivered.connect(items.append)
    return items


class Gate:
    """A job that delivers its name once it is let through, and polls while it waits."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.started, self.open, self.stopped = Event(), Event(), Event()

    def __call__(self, deliver, progress, should_stop) -> None:
        self.started.set()
        while not self.open.wait(0.002):
            if should_stop():
                self.stopped.set()
                break
        deliver(self.name)


def test_a_result_arrives_on_the_thread_of_the_window(qtbot, worker):
    threads: list[threading.Thread] = []
    worker.delivered.connect(lambda _: threads.append(threading.current_thread()))
    with qtbot.waitSignal(worker.idle):
        worker.submit(lambda deliver, progress, should_stop: deliver(threading.current_thread()))
    assert threads == [threading.main_thread()]


def test_a_stream_of_jobs_leaves_no_queue(qtbot, worker, heard):
    first = Gate("first")
    worker.submit(first)
    assert first.started.wait(2)
    ran: list[int] = []
    for number in range(100):
        worker.submit(lambda deliver, progress, should_stop, number=number: ran.append(number))
    with qtbot.waitSignal(worker.idle):
        first.open.set()
    assert ran == [99]
    assert heard == ["first"]  # it was not cancelled, so a drag does not starve


def test_cancelling_stops_the_running_job_and_drops_what_it_still_says(qtbot, worker, heard):
    stale, fresh = Gate("stale"), Gate("fresh")
    fresh.open.set()
    worker.submit(stale)
    assert stale.started.wait(2)
    worker.cancel()
    with qtbot.waitSignal(worker.idle):
        worker.submit(fresh)
    assert stale.stopped.is_set()
    assert heard == ["fresh"]


def test_cancelling_forgets_the_waiting_job_and_says_when_it_is_idle(qtbot, worker, heard):
    running, waiting = Gate("running"), Gate("waiting")
    worker.submit(running)
    assert running.started.wait(2)
    worker.submit(waiting)
    with qtbot.waitSignal(worker.idle):
        worker.cancel()
    assert not waiting.started.is_set()
    assert heard == []


def test_an_error_is_handed_over_and_the_worker_lives_on(qtbot, worker, heard):
    def fail(deliver, progress, should_stop):
        raise ValueError("no such thing")

    with qtbot.waitSignal(worker.failed) as caught:
        worker.submit(fail)
    assert str(caught.args[0]) == "no such thing"
    with qtbot.waitSignal(worker.delivered):
        worker.submit(lambda deliver, progress, should_stop: deliver(1))
    assert heard == [1]


def test_closing_ends_the_thread_even_in_the_middle_of_a_job(qtbot):
    worker = Worker()
    heard: list[object] = []
    worker.delivered.connect(heard.append)
    gate = Gate("late")
    worker.submit(gate)
    assert gate.started.wait(2)
    worker.close()
    worker.submit(gate)
    qtbot.wait(20)
    assert heard == []
    assert not [thread for thread in threading.enumerate() if thread.name == "naisr-worker"]


def test_synchronous_mode_is_done_when_submit_returns(qtbot):
    worker = Worker(synchronous=True)
    heard: list[object] = []
    worker.delivered.connect(heard.append)
    worker.submit(lambda deliver, progress, should_stop: deliver("at once"))
    assert heard == ["at once"]


def test_cancelling_what_has_not_begun_ends_in_idleness(qtbot, worker, heard):
    """Whoever gets there first, the thread that takes the job or the one that cancels it."""
    for _ in range(50):
        with qtbot.waitSignal(worker.idle, timeout=2000):
            worker.submit(lambda deliver, progress, should_stop: deliver("late"))
            worker.cancel()
    assert heard == []
