"""Colours: one accent, one colour per covariate, light and dark."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from PySide6.QtCore import Qt
from PySide6.QtGui import QColor, QGuiApplication, QPalette

from naisr_viewer.state.explorer import AtlasCard, Panel


class ThemeChoice(StrEnum):
    """What the View menu offers."""

    SYSTEM = "system"
    LIGHT = "light"
    DARK = "dark"


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

TEMPLATE_COLOUR = "#a7adb8"
SHAPE_COLOUR = "#6f9fe8"
BEFORE_COLOUR = "#a3b4d2"
SCAN_COLOUR = "#b9b2a6"
COVARIATE_COLOURS = ("#e29a3b", "#4fae86", "#c0699f", "#46a9bd", "#d0694f", "#8f7fd6", "#a7a042", "#7f8ea6")
"""Told apart by colour-blind eyes as far as eight colours can be; repeated beyond eight."""

SIGNED_COLOURS = (
    "#2957a8", "#4379c4", "#6b9bd3", "#9bb9d8", "#d1d5d8", "#d7b092", "#d3885a", "#c55f28", "#aa3600",
)  # fmt: skip
"""From minus to plus the limit, with nothing in the middle: equal steps to the eye (in OKLab), and told
apart by colour-blind ones, because the ends differ in blueness."""

UNSIGNED_COLOURS = (
    "#e1e1bb", "#b9d0a8", "#8dbf9f", "#60ad9e", "#3598a0", "#1881a1", "#22689e", "#354d94", "#423182",
)  # fmt: skip
"""From nothing to the limit: equal steps to the eye (in OKLab), darker at each."""


def covariate_colour(atlas: AtlasCard, name: str) -> str:
    """The colour of a covariate, everywhere."""
    return COVARIATE_COLOURS[atlas.index(name) % len(COVARIATE_COLOURS)]


def panel_colour(atlas: AtlasCard, panel: Panel) -> str:
    """The colour of a panel's surface, where its vertices have none of their own."""
    if panel.kind == "effect":
        return covariate_colour(atlas, panel.covariate)
    plain = {"template": TEMPLATE_COLOUR, "scan": SCAN_COLOUR, "before": BEFORE_COLOUR}
    return plain.get(panel.kind, SHAPE_COLOUR)


def ghost_colour(theme: Theme) -> str:
    """What lies translucent over a shape: grey that is told from the shape's colour and from the ground."""
    return "#c3c8cf" if theme.is_dark else "#454b55"


def scale_colours(is_signed: bool) -> tuple[str, ...]:
    """The colours of a scale at equal distances from its low to its high end."""
    return SIGNED_COLOURS if is_signed else UNSIGNED_COLOURS


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


def style_sheet(theme: Theme) -> str:
    """``theme`` for the parts that the palette does not reach."""
    t = theme
    return f"""
    QWidget {{ font-size: 10pt; }}
    QToolTip {{ background: {t.raised}; color: {t.text}; border: 1px solid {t.line}; padding: 4px; }}
    QMenuBar {{ background: {t.window}; border-bottom: 1px solid {t.line}; }}
    QMenuBar::item {{ padding: 5px 10px; background: transparent; }}
    QMenuBar::item:selected {{ background: {t.line}; border-radius: 4px; }}
    QMenu {{ background: {t.raised}; border: 1px solid {t.line}; padding: 4px; }}
    QMenu::item {{ padding: 5px 28px 5px 24px; border-radius: 4px; }}
    QMenu::item:selected {{ background: {t.accent}; color: {t.on_accent}; }}
    QMenu::item:disabled {{ color: {t.muted}; }}
    QMenu::separator {{ height: 1px; background: {t.line}; margin: 4px 8px; }}
    QToolBar {{ background: {t.window}; border: none; border-bottom: 1px solid {t.line};
                padding: 4px 8px; spacing: 6px; }}
    QToolBar::separator {{ width: 1px; background: {t.line}; margin: 4px 6px; }}
    QPushButton, QToolBar QToolButton {{ background: {t.raised}; border: 1px solid {t.line};
                border-radius: 5px; padding: 4px 12px; color: {t.text}; }}
    QPushButton:hover, QToolBar QToolButton:hover {{ border-color: {t.accent}; }}
    QPushButton:pressed, QToolBar QToolButton:pressed {{ background: {t.line}; }}
    QPushButton:checked, QToolBar QToolButton:checked {{ background: {t.accent}; color: {t.on_accent};
                border-color: {t.accent}; }}
    QPushButton:default {{ border-color: {t.accent}; }}
    QPushButton:disabled, QToolBar QToolButton:disabled {{ color: {t.muted}; background: {t.window}; }}
    QToolBar QToolButton:checked:disabled {{ color: {t.muted}; background: {t.line};
                border-color: {t.line}; }}
    QPushButton:focus {{ border-color: {t.accent}; }}
    QDoubleSpinBox, QLineEdit {{ background: {t.raised}; border: 1px solid {t.line};
                border-radius: 5px; padding: 3px 6px; color: {t.text};
                selection-background-color: {t.accent}; }}
    QDoubleSpinBox::up-button, QDoubleSpinBox::down-button {{ width: 0; border: none; }}
    QDoubleSpinBox QLineEdit {{ border: none; background: transparent; padding: 0 6px; }}
    QDoubleSpinBox:focus, QLineEdit:focus {{ border-color: {t.accent}; }}
    QStatusBar {{ background: {t.window}; border-top: 1px solid {t.line}; }}
    QStatusBar::item {{ border: none; }}
    QProgressBar {{ background: {t.line}; border: none; border-radius: 3px; max-height: 6px; }}
    QProgressBar::chunk {{ background: {t.accent}; border-radius: 3px; }}
    QScrollArea, #sidebar, #patientBar {{ background: {t.window}; border: none; }}
    #sidebar {{ border-right: 1px solid {t.line}; }}
    #patientBar {{ border-left: 1px solid {t.line}; }}
    #patientList {{ background: {t.raised}; border: 1px solid {t.line}; border-radius: 5px; padding: 2px;
                outline: none; }}
    #patientList:focus {{ border-color: {t.accent}; }}
    #patientList::item {{ border-left: 3px solid transparent; border-radius: 3px; }}
    #patientList::item:hover {{ background: {t.window}; }}
    #patientList::item:selected {{ background: {t.line}; border-left-color: {t.accent}; color: {t.text}; }}
    #sidebar QScrollBar:vertical, #patientBar QScrollBar:vertical {{ background: transparent; width: 10px;
                margin: 0; }}
    #sidebar QScrollBar::handle:vertical, #patientBar QScrollBar::handle:vertical {{ background: {t.line};
                border-radius: 3px; margin: 2px; min-height: 32px; }}
    #sidebar QScrollBar::handle:vertical:hover, #patientBar QScrollBar::handle:vertical:hover {{
                background: {t.muted}; }}
    #sidebar QScrollBar::add-line, #sidebar QScrollBar::sub-line,
    #patientBar QScrollBar::add-line, #patientBar QScrollBar::sub-line {{ height: 0; }}
    #patientBar QComboBox {{ background: {t.raised}; border: 1px solid {t.line}; border-radius: 5px;
                padding: 3px 8px; color: {t.text}; }}
    #patientBar QComboBox:hover, #patientBar QComboBox:focus {{ border-color: {t.accent}; }}
    #patientBar QComboBox:disabled {{ color: {t.muted}; background: {t.window}; }}
    #patientBar QComboBox::drop-down {{ border: none; width: 20px; }}
    #patientBar QComboBox QAbstractItemView {{ background: {t.raised}; border: 1px solid {t.line};
                selection-background-color: {t.accent}; selection-color: {t.on_accent}; outline: none; }}
    #patientBar QComboBox QAbstractItemView::item {{ padding: 4px 8px; }}
    #sidebar QCheckBox::indicator:unchecked, #patientBar QCheckBox::indicator:unchecked {{
                background: {t.raised}; border: 1px solid {t.muted}; border-radius: 2px;
                width: 12px; height: 12px; }}
    #small {{ padding: 1px 8px; font-size: 9pt; }}
    #section {{ font-size: 11pt; font-weight: 600; }}
    #figure {{ font-weight: 600; }}
    #changed {{ background: {t.raised}; border: 1px solid {t.accent}; border-radius: 6px; }}
    #blocked {{ background: {t.error}; color: {t.on_error}; border-radius: 6px; padding: 8px 10px; }}
    #primary {{ background: {t.accent}; border-color: {t.accent}; color: {t.on_accent}; padding: 6px 12px;
                font-weight: 600; }}
    #primary:hover, #primary:focus {{ border-color: {t.text}; }}
    #primary:pressed {{ background: {t.line}; color: {t.text}; }}
    #primary:disabled {{ background: {t.window}; border-color: {t.line}; color: {t.muted}; }}
    #title {{ font-size: 15pt; font-weight: 600; }}
    #covariate {{ font-weight: 600; }}
    #muted {{ color: {t.muted}; }}
    #panelTitle {{ font-weight: 600; color: {t.text}; background: {t.canvas}; padding-left: 10px; }}
    #volume {{ color: {t.text}; background: {t.canvas}; }}
    #status {{ padding-left: 12px; }}
    #separator {{ background: {t.line}; }}
    #canvasArea {{ background: {t.canvas}; }}
    #dropZone {{ border: 2px dashed {t.line}; border-radius: 14px; }}
    #emptyTitle {{ font-size: 18pt; font-weight: 600; }}
    #errorBar {{ background: {t.error}; }}
    #errorBar QLabel {{ color: {t.on_error}; }}
    #errorBar QPushButton {{ background: transparent; color: {t.on_error}; border-color: {t.on_error}; }}
    """
