"""The colours of the window: one accent, light and dark."""

from __future__ import annotations

from dataclasses import dataclass

from PySide6.QtCore import Qt
from PySide6.QtGui import QColor, QGuiApplication, QPalette

from naisr_viewer.state.theme import ThemeChoice


@dataclass(frozen=True)
class Theme:
    """Colours of the window, as ``#rrggbb``.

    Attributes:
        window: behind the controls.
        raised: input fields, buttons, cards.
        canvas: behind the shapes.
        line: separators and outlines.
        text: words and numbers.
        muted: units, hints, histograms.
        accent: the one colour of things that can be acted on.
        on_accent: text on the accent colour.
        error: behind an error message.
        on_error: text of an error message.
        is_dark: whether shapes stand on a dark ground.
    """

    window: str
    raised: str
    canvas: str
    line: str
    text: str
    muted: str
    accent: str
    on_accent: str
    error: str
    on_error: str
    is_dark: bool


LIGHT = Theme(
    window="#f3f4f6",
    raised="#ffffff",
    canvas="#fbfbfc",
    line="#d5d8de",
    text="#1d2430",
    muted="#667085",
    accent="#2f6fdb",
    on_accent="#ffffff",
    error="#fde8e6",
    on_error="#8c1d18",
    is_dark=False,
)
DARK = Theme(
    window="#22262d",
    raised="#2c313a",
    canvas="#191c21",
    line="#3d444f",
    text="#e6e9ee",
    muted="#99a2b1",
    accent="#6aa1ff",
    on_accent="#10151d",
    error="#4a2422",
    on_error="#ffd9d4",
    is_dark=True,
)


def resolved(choice: ThemeChoice) -> Theme:
    """The colours for ``choice``; the system's preference decides where it is ``SYSTEM``."""
    if choice is ThemeChoice.SYSTEM:
        is_dark = QGuiApplication.styleHints().colorScheme() == Qt.ColorScheme.Dark
        return DARK if is_dark else LIGHT
    return DARK if choice is ThemeChoice.DARK else LIGHT


def palette(theme: Theme) -> QPalette:
    """``theme`` for the widgets that Qt draws."""
    result = QPalette()
    role = QPalette.ColorRole
    colours = {
        role.Window: theme.window,
        role.WindowText: theme.text,
        role.Base: theme.raised,
        role.AlternateBase: theme.window,
        role.Text: theme.text,
        role.PlaceholderText: theme.muted,
        role.Button: theme.raised,
        role.ButtonText: theme.text,
        role.ToolTipBase: theme.raised,
        role.ToolTipText: theme.text,
        role.Highlight: theme.accent,
        role.HighlightedText: theme.on_accent,
        role.Link: theme.accent,
        role.Mid: theme.line,
    }
    for each, colour in colours.items():
        result.setColor(each, QColor(colour))
    for each in (role.WindowText, role.Text, role.ButtonText):
        result.setColor(QPalette.ColorGroup.Disabled, each, QColor(theme.muted))
    return result
