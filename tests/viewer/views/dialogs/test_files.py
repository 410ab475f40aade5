"""Which files can be chosen."""

from __future__ import annotations

from pathlib import Path

import pytest
from PySide6.QtWidgets import QFileDialog, QWidget
from pytestqt.qtbot import QtBot

from naisr_model.data import meshes, volumes
from naisr_model.data.patients import POINT_ENDINGS
from naisr_viewer.state.explorer import ExplorerState
from naisr_viewer.views.dialogs.files import SCAN_ENDINGS, ask_image_path, ask_scan_path


@pytest.fixture
def parent(qtbot: QtBot) -> QWidget:
    widget = QWidget()
    qtbot.addWidget(widget)
    return widget


def test_every_ending_that_the_model_reads_can_be_chosen(parent, monkeypatch):
    readable = meshes.READERS | POINT_ENDINGS | set(volumes.ENDINGS)
    assert {f".{ending}" for ending in SCAN_ENDINGS} == readable
    offered: list[str] = []

    def answer(_parent: QWidget, _title: str, _folder: str, filters: str) -> tuple[str, str]:
        offered.append(filters)
        return "/scans/p01.stl", filters

    monkeypatch.setattr(QFileDialog, "getOpenFileName", answer)
    assert ask_scan_path(parent, None) == Path("/scans/p01.stl")
    assert all(f"*{ending}" in offered[0] for ending in readable)


@pytest.mark.parametrize(
    ("typed", "name"),
    [
        ("fig", "fig.png"),
        ("fig.png", "fig.png"),
        ("fig.PNG", "fig.PNG"),
        ("fig.age150", "fig.age150.png"),
        ("fig.", "fig..png"),
    ],
)
def test_a_picture_gets_an_ending_and_loses_none(parent, monkeypatch, typed, name):
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (f"/pictures/{typed}", ""))
    assert ask_image_path(parent, ExplorerState()) == Path(f"/pictures/{name}")
