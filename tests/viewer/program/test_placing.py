"""Size and place of the window from one run to the next."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QByteArray, QPoint, QSize

from naisr_viewer.control.preferences import Preferences
from naisr_viewer.program.placing import place
from naisr_viewer.views.main_window import MainWindow


def shown(qtbot, settings, pixels: tuple[int, int] | None) -> MainWindow:
    window = MainWindow()
    place(window, pixels, Preferences(settings))
    with qtbot.waitExposed(window):
        window.show()
    return window


def close(window: MainWindow) -> None:
    window.close()
    window.deleteLater()


def test_at_first_it_fits_the_screen_with_its_frame(qtbot, settings):
    window = shown(qtbot, settings, None)
    assert window.screen().availableGeometry().contains(window.geometry())
    assert window.size() == QSize(1280, 800)  # the screen of the tests is larger
    close(window)


def test_it_opens_where_it_was_closed(qtbot, settings):
    window = shown(qtbot, settings, None)
    window.setGeometry(120, 90, 1000, 640)
    qtbot.waitUntil(lambda: window.geometry().topLeft() == QPoint(120, 90))
    close(window)
    again = shown(qtbot, settings, None)
    assert again.geometry().getRect() == (120, 90, 1000, 640)
    close(again)


def test_a_size_that_is_asked_for_counts_more(qtbot, settings):
    close(shown(qtbot, settings, (1000, 640)))
    window = shown(qtbot, settings, (900, 700))
    assert window.size() == QSize(900, 700)
    close(window)


@pytest.mark.parametrize("spoilt", [QByteArray(b"nonsense"), "text", 7])
def test_what_cannot_be_read_is_as_if_it_were_not_there(qtbot, settings, spoilt):
    settings.setValue("geometry", spoilt)
    window = shown(qtbot, settings, None)
    assert window.size() == QSize(1280, 800)
    close(window)
