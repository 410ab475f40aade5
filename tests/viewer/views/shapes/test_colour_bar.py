"""Colours that stand for millimetres, and the bar that says which."""

from __future__ import annotations

import numpy as np
import pytest
from PySide6.QtGui import QColor
from pytestqt.qtbot import QtBot

from naisr_viewer.views.colours import scale_colours
from naisr_viewer.views.shapes import colour_bar as cb
from naisr_viewer.views.shapes.canvas import look_up_table
from naisr_viewer.views.theme import DARK, LIGHT, palette


def rgb(colour: str) -> np.ndarray:
    return np.array([QColor(colour).redF(), QColor(colour).greenF(), QColor(colour).blueF()])


def linear(colour: np.ndarray) -> np.ndarray:
    return np.where(colour <= 0.04045, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4)


def oklab(linear_rgb: np.ndarray) -> np.ndarray:
    """Lightness, greenness to redness, blueness to yellowness as the eye has them (Ottosson, 2020)."""
    to_cones = np.array(
        [
            [0.4122214708, 0.5363325363, 0.0514459929],
            [0.2119034982, 0.6806995451, 0.1073969566],
            [0.0883024619, 0.2817188376, 0.6299787005],
        ]
    )
    to_lab = np.array(
        [
            [0.2104542553, 0.7936177850, -0.0040720468],
            [1.9779984951, -2.4285922050, 0.4505937099],
            [0.0259040371, 0.7827717662, -0.8086757660],
        ]
    )
    return np.cbrt(linear_rgb @ to_cones.T) @ to_lab.T


DEUTERANOPIA = np.array(
    [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
)
"""How linear colours look without green cones (Machado and others, 2009, severity 1)."""


@pytest.mark.parametrize("is_signed", [True, False])
def test_equal_steps_look_equal(is_signed):
    seen = oklab(linear(np.array([rgb(colour) for colour in scale_colours(is_signed)])))
    steps = np.linalg.norm(np.diff(seen, axis=0), axis=1)
    assert steps.max() / steps.min() < 1.1


def test_an_unsigned_scale_gets_darker_and_a_signed_one_is_lightest_in_the_middle():
    def lightness(is_signed: bool) -> np.ndarray:
        return oklab(linear(np.array([rgb(colour) for colour in scale_colours(is_signed)])))[:, 0]

    assert (np.diff(lightness(is_signed=False)) < 0).all()
    signed = lightness(is_signed=True)
    assert (np.diff(signed[:5]) > 0).all() and (np.diff(signed[4:]) < 0).all()


def test_colour_blind_eyes_tell_plus_from_minus():
    colours = linear(np.array([rgb(colour) for colour in scale_colours(is_signed=True)]))
    seen = oklab((colours @ DEUTERANOPIA.T).clip(0, 1))
    for step in range(1, 5):
        assert np.linalg.norm(seen[4 + step] - seen[4 - step]) > 0.045 * step


@pytest.mark.parametrize(
    ("limit_mm", "is_signed", "expected"),
    [(5.0, True, ("−5", "0", "+5")), (2.0, False, ("0", "1", "2")), (1.5, False, ("0", "0.75", "1.5"))],
)
def test_ends_and_middle_are_named(limit_mm, is_signed, expected):
    assert cb.labels(limit_mm, is_signed) == expected


def make(qtbot: QtBot, is_signed: bool, theme=LIGHT) -> cb.ColourBar:
    bar = cb.ColourBar(is_signed)
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


@pytest.mark.parametrize("is_signed", [True, False])
def test_the_bar_has_the_colours_of_the_surfaces(qtbot, is_signed):
    bar = make(qtbot, is_signed)
    line = picture(bar)[10, round(bar.band.left()) + 1 : round(bar.band.right()) - 1]
    table = look_up_table(3.0, is_signed)
    assert table.scalar_range == (-3.0 if is_signed else 0.0, 3.0)
    for share in np.linspace(0.03, 0.97, 9):
        on_surface = table.values[round(share * 255), :3].astype(int)
        np.testing.assert_allclose(line[round(share * (len(line) - 1))], on_surface, atol=10)


def test_values_beyond_the_ends_have_the_colours_of_the_ends():
    table = look_up_table(2.0, is_signed=True)
    for value, end in ((-9.0, "#2957a8"), (-2.0, "#2957a8"), (2.0, "#aa3600"), (9.0, "#aa3600")):
        assert QColor.fromRgbF(*table.map_value(value, opacity=False)).name() == end


@pytest.mark.parametrize("theme", [LIGHT, DARK], ids=["light", "dark"])
def test_numbers_are_whole_and_in_the_colour_of_words(qtbot, theme):
    bar = make(qtbot, is_signed=True, theme=theme)
    ground = rgb(theme.window) * 255
    assert np.abs(picture(bar)[cb.BAND_PX + 7 :] - ground).max() < 9  # no numbers before a limit is known
    bar.set_limit(12.5)
    written = picture(bar)
    inked = np.abs(written - ground).sum(axis=2) > 90
    assert inked[cb.BAND_PX + 7 :].sum() > 60
    assert not inked[:, [0, -1]].any() and not inked[[0, -1]].any()
    darkest = written[cb.BAND_PX + 7 :][np.abs(written - ground).sum(axis=2)[cb.BAND_PX + 7 :] > 90]
    assert np.abs(darkest - rgb(theme.text) * 255).sum(axis=1).min() < 120
