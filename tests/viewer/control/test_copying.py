"""What is copied arrives in other programs as it is on screen."""

from __future__ import annotations

import csv
import io

import pytest
from PySide6.QtGui import QGuiApplication

from naisr_viewer.control.copying import CopyDesk
from naisr_viewer.control.section import SectionDesk
from naisr_viewer.program.headless import finish
from naisr_viewer.state.layouts import FULL_SHAPE


@pytest.fixture
def ready(open_window, atlas_file):
    window, controller = open_window((1000, 700))
    SectionDesk(window, controller)
    CopyDesk(window, controller)
    controller.open(atlas_file)
    finish(window, controller)
    window.covariates.value_settled.emit("age", 180.0)
    finish(window, controller)
    return window, controller


def rows() -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(QGuiApplication.clipboard().text()), delimiter="\t"))


def test_a_table_has_a_row_a_view_with_covariates_volume_and_cut(ready, atlas):
    window, controller = ready
    window.table_copy_requested.emit()
    found = {row["view"]: row for row in rows()}
    assert list(found) == ["Template", "Age only", "Weight only", "Sex only", "Full shape"]
    whole = found["Full shape"]
    assert whole["age [months]"] == "180" and whole["cut [mm²]"] == ""
    assert float(whole["volume [cm³]"]) == pytest.approx(
        atlas.volume_cm3(**dict(controller.state.named)), rel=0.01
    )
    assert found["Age only"]["weight [kg]"] == "" and found["Template"]["age [months]"] == ""
    window.section_switched.emit()
    window.table_copy_requested.emit()
    cut_mm2 = float(rows()[-1]["cut [mm²]"])
    assert f"cut {cut_mm2:,.0f}\u00a0mm²" in window.shapes.caption(FULL_SHAPE)


def test_a_picture_has_the_shapes_and_their_words_and_nothing_else(ready):
    window, _ = ready
    window.picture_copy_requested.emit()
    picture = QGuiApplication.clipboard().image()
    ratio = window.devicePixelRatioF()
    assert (picture.width(), picture.height()) == (
        round(window.shapes.width() * ratio), round(window.shapes.height() * ratio),
    )  # fmt: skip
    colours = {
        picture.pixelColor(x, y).name() for x in range(0, picture.width(), 7) for y in range(0, 400, 7)
    }
    assert len(colours) > 50
