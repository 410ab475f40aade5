"""Axes that were rounded on their way into a file, and axes that are sheared; the truth is the rotation."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from naisr_model.data.images.base import MOST_SHIFT, shift, squared
from naisr_model.errors import InputError

SPACINGS = ((0.3, 0.3, 0.6), (1.0, 1.0, 1.0), (0.9765625, 0.9765625, 3.0))
TURNS = Rotation.random(60, random_state=0).as_matrix()


def placed(axes: np.ndarray) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3] = axes
    return matrix


def sheared(turn: np.ndarray, spacing, degrees: float) -> np.ndarray:
    shear = np.eye(3)
    shear[0, 1] = np.tan(np.radians(degrees))
    return turn @ shear * spacing


@pytest.mark.parametrize("size", [64, 128, 256, 512])
@pytest.mark.parametrize("decimals", [3, 4])
@pytest.mark.parametrize("spacing", SPACINGS)
def test_rounded_rotations_are_read_and_told_where_that_shows(size, decimals, spacing):
    """Directions times spacing, or both rounded together, also through single precision."""
    told = 0
    for turn in TURNS:
        for axes in (turn.round(decimals) * spacing, (turn * spacing).round(decimals).astype(np.float32)):
            matrix = placed(np.asarray(axes, np.float64))
            straight, remarks = squared("a.nii", np.eye(4), matrix, [size] * 3)
            directions = straight[:3, :3] / np.linalg.norm(straight[:3, :3], axis=0)
            np.testing.assert_allclose(directions.T @ directions, np.eye(3), atol=1e-12)
            # Half a unit of the last decimal an entry, of three, straightened: no more than twice that.
            np.testing.assert_allclose(
                directions, turn, atol=2 * np.sqrt(3) * 0.5 * 10.0**-decimals / min(*spacing, 1)
            )
            assert bool(remarks) == (shift(straight, matrix, [size] * 3) > MOST_SHIFT)
            assert all((one.severity, one.topic) == ("fine", "axes") for one in remarks)
            told += bool(remarks)
    assert told if (size, decimals) == (512, 3) else not told or (size, decimals) != (64, 4)


@pytest.mark.parametrize("size", [64, 256, 512])
@pytest.mark.parametrize(
    ("degrees", "decimals"), [(0.5, 3), (0.5, 6), (0.5, 16), (2.0, 2), (2.0, 3), (2.0, 16)]
)
def test_true_shears_are_refused(size, degrees, decimals):
    for turn in (np.eye(3), *TURNS):
        for spacing in SPACINGS:
            matrix = placed(sheared(turn, spacing, degrees).round(decimals))
            with pytest.raises(InputError, match=r"the axes of a\.nii are not at right angles; resample"):
                squared("a.nii", np.eye(4), matrix, [size] * 3)


def test_a_small_image_may_be_sheared_by_less_than_shows():
    straight, remarks = squared("a.nii", np.eye(4), placed(sheared(np.eye(3), (1, 1, 1), 0.5)), [20] * 3)
    assert remarks == ()
    np.testing.assert_allclose(straight[:3, :3].T @ straight[:3, :3], np.eye(3), atol=1e-4)


def test_the_unit_of_the_file_changes_nothing():
    axes = placed(TURNS[0].round(3))
    one, remarks = squared("a.nii", np.eye(4), axes, [512] * 3)
    other, others = squared("a.nii", np.diag([1000.0, 1000, 1000, 1]), axes, [512] * 3)
    np.testing.assert_allclose(other[:3], 1000 * one[:3])
    assert len(remarks) == len(others)
