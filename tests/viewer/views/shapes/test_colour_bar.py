"""The bar that says which colour stands for how many millimetres."""

from __future__ import annotations

import numpy as np
import pytest
from PySide6.QtGui import QColor
from pytestqt.qtbot import QtBot

from naisr_viewer.state.requests import Scale
from naisr_viewer.views.shapes import colour_bar as cb
from naisr_viewer.views.shapes.looks import look_up_table
from naisr_viewer.views.theme import DARK, LIGHT, palette


def rgb(colour: str) -> np.ndarray:
    return np.array([QColor(colour).redF(), QColor(colour).greenF(), QColor(colour).blueF()])


@pytest.mark.parametrize(
    ("limit", "scale", "expected"),
    [
        (5.0, "signed", ("−5", "0", "+5")),
        (2.0, "unsigned", ("0", "1", "2")),
        (1.5, "unsigned", ("0", "0.75", "1.5")),
    ],
)
def test_ends_and_middle_are_named(limit, scale, expected):
    assert cb.labels(limit, scale) == expected


def make(qtbot: QtBot, scale: Scale, theme=LIGHT) -> cb.ColourBar:
    bar = cb.ColourBar(scale, "mm")
    qtbot.addWidget(bar)
    bar.setPalette(palette(theme))
    bar.setAutoFillBackground(True)
    bar.resize(bar.sizeHint())
    bar.show()
    return bar


def picture(bar: cb.ColourBar) -> np.ndarray:
    image = bar.grab().toImage()
    rows = [[image.pixelColor(x, y) for x in range(image.width())] for y in range(image.height())]
    return np.array([[(c.red(), c.green(), c.blue()) for c in row] for row in rows])


@pytest.mark.parametrize("scale", ["signed", "unsigned"])
def test_the_bar_has_the_colours_of_the_surfaces(qtbot, scale):
    bar = make(qtbot, scale)
    line = picture(bar)[10, round(bar.band.left()) + 1 : round(bar.band.right()) - 1]
    table = look_up_table(3.0, scale)
    assert table.scalar_range == (-3.0 if scale == "signed" else 0.0, 3.0)
    for share in np.linspace(0.03, 0.97, 9):
        on_surface = table.values[round(share * 255), :3].astype(int)
        np.testing.assert_allclose(line[round(share * (len(line) - 1))], on_surface, atol=10)


@pytest.mark.parametrize("theme", [LIGHT, DARK], ids=["light", "dark"])
def test_numbers_are_whole_and_in_the_colour_of_words(qtbot, theme):
    bar = make(qtbot, scale="signed", theme=theme)
    ground = rgb(theme.window) * 255
    assert np.abs(picture(bar)[cb.BAND_PX + 7 :] - ground).max() < 9  # no numbers before a limit is known
    bar.set_limit(12.5)
    written = picture(bar)
    inked = np.abs(written - ground).sum(axis=2) > 90
    assert inked[cb.BAND_PX + 7 :].sum() > 60
    assert not inked[:, [0, -1]].any() and not inked[[0, -1]].any()
    darkest = written[cb.BAND_PX + 7 :][np.abs(written - ground).sum(axis=2)[cb.BAND_PX + 7 :] > 90]
    assert np.abs(darkest - rgb(theme.text) * 255).sum(axis=1).min() < 120
