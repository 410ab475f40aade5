"""Colours that stand for millimetres, as eyes see them."""

from __future__ import annotations

import numpy as np
import pytest
from PySide6.QtGui import QColor

from naisr_viewer.state.requests import Scale
from naisr_viewer.views.colours import SCALE_COLOURS


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


@pytest.mark.parametrize("scale", SCALE_COLOURS)
def test_equal_steps_look_equal(scale):
    seen = oklab(linear(np.array([rgb(colour) for colour in SCALE_COLOURS[scale]])))
    steps = np.linalg.norm(np.diff(seen, axis=0), axis=1)
    assert steps.max() / steps.min() < 1.1


def test_an_unsigned_scale_gets_darker_and_a_signed_one_is_lightest_in_the_middle():
    def lightness(scale: Scale) -> np.ndarray:
        return oklab(linear(np.array([rgb(colour) for colour in SCALE_COLOURS[scale]])))[:, 0]

    assert (np.diff(lightness("unsigned")) < 0).all()
    signed = lightness("signed")
    assert (np.diff(signed[:5]) > 0).all() and (np.diff(signed[4:]) < 0).all()


def test_colour_blind_eyes_tell_plus_from_minus():
    colours = linear(np.array([rgb(colour) for colour in SCALE_COLOURS["signed"]]))
    seen = oklab((colours @ DEUTERANOPIA.T).clip(0, 1))
    for step in range(1, 5):
        assert np.linalg.norm(seen[4 + step] - seen[4 - step]) > 0.045 * step
