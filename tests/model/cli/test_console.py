"""Progress where no bar can be drawn."""

from __future__ import annotations

import signal
import time

import pytest

from naisr_model.cli import console
from naisr_model.cli.console import bar, stoppable
from naisr_model.errors import Cancelled


def test_a_long_work_tells_a_line_now_and_then_whatever_it_is_at(capsys, monkeypatch):
    monkeypatch.setattr(console, "LINE_S", 0.01)
    with bar("preparing") as progress:
        progress.check()
        progress.tell(0.42)
        said = ""
        while said.count("preparing: 42 %\n") < 2:  # nothing is told meanwhile
            time.sleep(0.01)
            said += capsys.readouterr().err
        progress.tell(1.0)
    assert capsys.readouterr().err.endswith("preparing: 100 %\n")


def test_nothing_is_told_before_the_input_was_checked(capsys, monkeypatch):
    monkeypatch.setattr(console, "LINE_S", 0.001)
    with pytest.raises(ValueError, match="no table"), bar("preparing"):
        time.sleep(0.02)
        raise ValueError("no table")
    assert capsys.readouterr().err == ""


def test_work_that_failed_has_no_last_line(capsys):
    with pytest.raises(ValueError, match="no room"), bar("preparing") as progress:
        progress.check()
        raise ValueError("no room")
    assert capsys.readouterr().err == ""


def test_a_ctrl_c_that_the_work_does_not_ask_for_still_stops():
    with pytest.raises(Cancelled), stoppable():
        signal.raise_signal(signal.SIGINT)
