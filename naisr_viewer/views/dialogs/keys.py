"""All keys and what the mouse does, on one sheet."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence

from PySide6.QtGui import QKeySequence
from PySide6.QtWidgets import QDialog, QTextBrowser, QVBoxLayout, QWidget

from naisr_viewer.views.actions import COMMANDS, MENUS
from naisr_viewer.words.mouse import BESIDE, SHAPES

TITLE = "Keys and mouse"
WIDTH_PX, HEIGHT_PX = 560, 640

Row = tuple[str, str]
"""What is pressed or done, and what follows."""


def sheet() -> tuple[tuple[str, tuple[Row, ...]], ...]:
    """Headings with their rows: the mouse, then every command that has keys, as the menus have them."""
    commands = {command.name: command for command in COMMANDS}
    parts = [("On the shapes", SHAPES), ("Beside them", BESIDE)]
    for title, names in MENUS.items():
        with_keys = [commands[name] for name in names if name in commands and commands[name].keys]
        rows = tuple((" or ".join(map(_shown, each.keys)), each.tip or each.text) for each in with_keys)
        if rows:
            parts.append((title.replace("&", ""), rows))
    return tuple(parts)


class KeysSheet(QDialog):
    """The sheet, which stays open beside the window.

    Args:
        parent: the window it tells of.
    """

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.setWindowTitle(TITLE)
        self.resize(WIDTH_PX, HEIGHT_PX)
        self.browser = QTextBrowser(self)
        self.browser.setAccessibleName(TITLE)
        self.browser.setHtml("".join(_part(title, rows) for title, rows in sheet()))
        column = QVBoxLayout(self)
        column.addWidget(self.browser)


def _shown(keys: str) -> str:
    """As the platform writes them."""
    return QKeySequence(keys).toString(QKeySequence.SequenceFormat.NativeText)


def _part(title: str, rows: Sequence[Row]) -> str:
    cells: Iterable[str] = (
        f"<tr><td width='36%'><b>{html.escape(keys)}</b></td><td>{html.escape(text)}</td></tr>"
        for keys, text in rows
    )
    return f"<h3>{title}</h3><table width='100%' cellpadding='3'>{''.join(cells)}</table>"
