"""The documents that come with the program, in a window of their own."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from PySide6.QtCore import QSize, QUrl
from PySide6.QtGui import (
    QDesktopServices,
    QImage,
    QKeySequence,
    QShortcut,
    QTextBlock,
    QTextBlockFormat,
    QTextCursor,
    QTextDocument,
    QTextOption,
)
from PySide6.QtWidgets import QDialog, QHBoxLayout, QPushButton, QTextBrowser, QVBoxLayout, QWidget

FIRST_SIZE = QSize(860, 700)
FRAME = QSize(8, 40)
"""What a window manager puts around a window, at most."""

MARGIN_PX = 18
PAGE_ENDING = ".md"
PICTURE = "\N{OBJECT REPLACEMENT CHARACTER}"
CONTENTS = f"index{PAGE_ENDING}"


class DocumentWindow(QDialog):
    """Pages of Markdown that link to each other; what a link leads to out of them, the system opens.

    Args:
        folder: where the pages are; its ``index.md`` lists them.
        parent: the window it stays in front of.
    """

    def __init__(self, folder: Path, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._folder = folder
        self.setModal(False)
        self.resize(FIRST_SIZE.boundedTo(self.screen().availableSize() - FRAME))
        self.browser = QTextBrowser(self)
        self.browser.setOpenLinks(False)
        self.browser.setAccessibleName("Document")
        self.browser.setWordWrapMode(QTextOption.WrapMode.WrapAtWordBoundaryOrAnywhere)
        self.back = QPushButton("&Back", self)
        self.contents = QPushButton("&Contents", self)
        self._compose()
        self.browser.anchorClicked.connect(self._follow)
        self.browser.backwardAvailable.connect(self.back.setEnabled)
        self.back.clicked.connect(self._go_back)
        self.contents.clicked.connect(lambda: self.show_page(CONTENTS))
        QShortcut(QKeySequence(QKeySequence.StandardKey.Back), self, self._go_back)

    def show_page(self, name: str) -> None:
        """Show a page of the folder, and this window if it is hidden."""
        self._open(QUrl.fromLocalFile(str(self._folder / name)))
        self.show()
        self.raise_()

    def _compose(self) -> None:
        self.back.setEnabled(False)
        bar = QHBoxLayout()
        for each in (self.back, self.contents):
            each.setAutoDefault(False)
            bar.addWidget(each)
        bar.addStretch(1)
        column = QVBoxLayout(self)
        column.addLayout(bar)
        column.addWidget(self.browser, 1)

    def _open(self, url: QUrl) -> None:
        self.browser.setSource(url, QTextDocument.ResourceType.MarkdownResource)
        self._present()
        if url.hasFragment():
            self._go_to(url.fragment())

    def _go_back(self) -> None:
        self.browser.backward()
        self._present()

    def _present(self) -> None:
        document = self.browser.document()
        document.setDocumentMargin(MARGIN_PX)
        _break_lines(document)
        _fit_pictures(document, self.browser.viewport().width() - 2 * MARGIN_PX)
        self.setWindowTitle(document.firstBlock().text() or "Documents")

    def _go_to(self, anchor: str) -> None:
        """To the heading that a link names; Qt knows no anchors in Markdown."""
        for block in _headings(self.browser.document()):
            if anchor_of(block.text()) == anchor:
                self.browser.moveCursor(QTextCursor.MoveOperation.End)  # from below, it stops at the top
                self.browser.setTextCursor(QTextCursor(block))

    def _follow(self, link: QUrl) -> None:
        url = self.browser.source().resolved(link)
        if url.isLocalFile() and not Path(url.toLocalFile()).exists():
            self.setWindowTitle(f"{url.fileName()} comes with the source, not with the installed program")
        elif url.isLocalFile() and url.path().endswith(PAGE_ENDING):
            self._open(url)
        else:
            QDesktopServices.openUrl(url)


def anchor_of(heading: str) -> str:
    """What a link after ``#`` calls a heading: ``Your own shapes`` is ``your-own-shapes``."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


def _break_lines(document: QTextDocument) -> None:
    """Have listings wrapped; Qt keeps their lines whole, however wide that makes the page."""
    breakable = QTextBlockFormat()
    breakable.setNonBreakableLines(False)
    for block in _blocks(document):
        if block.blockFormat().nonBreakableLines():
            QTextCursor(block).mergeBlockFormat(breakable)


def _fit_pictures(document: QTextDocument, most_px: int) -> None:
    """Have no picture wider than the page; Qt shows them as large as they are."""
    for place in _pictures(document):
        cursor = QTextCursor(document)
        cursor.setPosition(place)
        cursor.setPosition(place + 1, QTextCursor.MoveMode.KeepAnchor)
        look = cursor.charFormat().toImageFormat()
        file = document.baseUrl().resolved(QUrl(look.name())).toLocalFile()
        look.setWidth(min(most_px, QImage(file).width()))
        cursor.setCharFormat(look)


def _pictures(document: QTextDocument) -> list[int]:
    """Where pictures stand; each is one character."""
    return [place for place, letter in enumerate(document.toRawText()) if letter == PICTURE]


def _headings(document: QTextDocument) -> Iterator[QTextBlock]:
    return (block for block in _blocks(document) if block.blockFormat().headingLevel())


def _blocks(document: QTextDocument) -> Iterator[QTextBlock]:
    block = document.begin()
    while block.isValid():
        yield block
        block = block.next()
