"""Jobs over a cluster: in any order, each once, whatever becomes of a worker."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import pytest

from naisr_model.errors import Cancelled, InputError
from naisr_model.progress import Progress
from naisr_model.work import cluster as clusters
from naisr_model.work.cluster import cluster
from naisr_model.work.run import in_order

pytest.importorskip("distributed", reason="the extra 'cluster' is not installed")


def square(job: tuple[int, Path]) -> int:
    """Leaves a trace of whoever does it, and takes a moment."""
    number, folder = job
    (folder / f"{number}.{os.getpid()}").touch()
    time.sleep(0.05)
    return number**2


def fail(number: int) -> int:
    raise InputError(f"{number} is no good")


def workers_of(folder: Path) -> set[int]:
    return {int(file.suffix[1:]) for file in folder.iterdir()}


def test_a_worker_that_is_killed_costs_nothing_but_what_it_was_at(tmp_path):
    jobs = [(number, tmp_path) for number in range(60)]
    found = []
    with cluster("local:2") as run:
        for number, result in run(square, jobs):
            found.append((number, result))
            if len(found) == 10:
                assert len(workers_of(tmp_path)) == 2
                os.kill(min(workers_of(tmp_path)), signal.SIGKILL)
    assert in_order(found) == [number**2 for number in range(60)]
    assert len(found) == 60
    assert len(list(tmp_path.iterdir())) <= 60 + 2 * clusters.AHEAD
    assert os.getpid() not in workers_of(tmp_path)


def test_what_goes_wrong_ends_the_run_as_over_processes():
    shares: list[float] = []
    with cluster("local:1") as run:
        assert in_order(run(abs, [-3, 2], Progress(shares.append))) == [3, 2]
        assert shares == [0.5, 1.0] and list(run(abs, [])) == []
        with pytest.raises(InputError, match="7 is no good"):
            list(run(fail, [7]))
        with pytest.raises(Cancelled):
            list(run(abs, [-3], Progress(is_unwanted=lambda: True)))


def test_workers_with_another_program_are_refused(monkeypatch):
    monkeypatch.setattr(clusters, "program", os.getpid)  # another number in every process
    told = r"have another program .* install the same on all"
    with pytest.raises(InputError, match=told), cluster("local:1"):
        pass


@pytest.mark.parametrize(
    ("address", "message"),
    [
        (
            "tcp://127.0.0.1:9",
            "no cluster answers at 'tcp://127.0.0.1:9'; give the address of a dask scheduler",
        ),
        ("nowhere", "no cluster answers at 'nowhere'"),
        ("local:0", "the cluster is 'local:0'; give local:1 to local:61"),
    ],
)
def test_an_address_that_leads_nowhere(address, message, monkeypatch):
    monkeypatch.setattr(clusters, "PATIENCE_S", 1)
    with pytest.raises(InputError, match=message), cluster(address):
        pass
