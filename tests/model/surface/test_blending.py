"""Values carried from some points to others."""

from __future__ import annotations

import numpy as np
import pytest

from naisr_model.surface.blending import blended


def test_a_known_point_keeps_its_value_and_the_middle_has_the_mean():
    known, values = np.array([[0.0, 0.0], [2.0, 0.0]]), np.array([1.0, 5.0])
    found = blended(known, values, np.array([[0.0, 0.0], [1.0, 0.0], [0.5, 0.0]]))
    assert found == pytest.approx([1.0, 3.0, (1 / 0.5 + 5 / 1.5) / (1 / 0.5 + 1 / 1.5)], abs=1e-5)


def test_only_the_nearest_four_count():
    known = np.array([[1.0], [-1.0], [1.0], [-1.0], [50.0]])
    assert blended(known, np.array([2.0, 2.0, 2.0, 2.0, 9.0]), np.zeros((1, 1))) == pytest.approx([2.0])


def test_a_single_known_point_will_do():
    assert blended(np.zeros((1, 3)), np.array([7.0]), np.ones((5, 3))) == pytest.approx(np.full(5, 7.0))
