"""The documents that come with the program."""

from __future__ import annotations

import pytest

from naisr_model.shipped import shipped
from naisr_viewer.program.headless import pause
from naisr_viewer.views.dialogs.documents import DocumentWindow

PAGES = sorted(page.name for page in shipped("docs").glob("*.md"))


@pytest.mark.parametrize("width", [620, 860])
def test_no_page_is_wider_than_its_window(qtbot, width):
    window = DocumentWindow(shipped("docs"))
    qtbot.addWidget(window)
    window.resize(width, 600)
    wide = []
    for page in PAGES:
        window.show_page(page)
        pause(0.02)
        if window.browser.horizontalScrollBar().maximum() > 0:
            wide.append(page)
    assert PAGES and wide == []
