"""Curves against discs, squares and a slower reference."""

from __future__ import annotations

import math

import numpy as np
import pytest

from naisr_model.data.populations import starman
from naisr_model.shapes.curve import Curve, closed, enclosed_area, thinned
from naisr_model.shapes.kinds import KINDS, kind_of
from naisr_model.shapes.written import csv_bytes


def ring(radius: float, count: int = 200) -> np.ndarray:
    angles = np.linspace(0, 2 * math.pi, count, endpoint=False)
    return radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)


def brute_force(curve: Curve, points: np.ndarray) -> np.ndarray:
    """Distance to every segment, and the angle under which the curve is seen from the point."""
    begin, end = (curve.vertices[curve.faces[:, side]] for side in (0, 1))
    step = end - begin
    along = ((points[:, None] - begin) * step).sum(axis=2) / (step**2).sum(axis=1)
    nearest = begin + np.clip(along, 0, 1)[..., None] * step
    away = np.linalg.norm(points[:, None] - nearest, axis=2).min(axis=1)
    a, b = begin - points[:, None], end - points[:, None]
    turned = np.arctan2(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0], (a * b).sum(axis=2)).sum(axis=1)
    return np.where(turned > math.pi, -away, away)


def test_signed_distances_are_exact() -> None:
    man = starman.true_shape({"arms": 0.5, "legs": -0.9})
    holed = closed([ring(1.0, 40), ring(0.5, 30)])
    points = np.random.default_rng(0).uniform(-1.3, 1.3, (1500, 2))
    for curve in (man, holed):
        assert curve.signed_distance(points) == pytest.approx(brute_force(curve, points), abs=1e-12)


@pytest.mark.parametrize("turn", [1, -1])
def test_a_disc_with_a_hole_has_its_area_length_and_outward_normals(turn: int) -> None:
    curve = closed([ring(2.0)[::turn], ring(1.0)])
    assert curve.pieces == 2 and len(curve.loops) == 2
    assert curve.area == pytest.approx(6 * math.pi, rel=1e-3)
    assert curve.volume == pytest.approx(3 * math.pi, rel=1e-3)
    assert abs(enclosed_area(curve) - 3 * math.pi) < abs(curve.volume - 3 * math.pi) / 20
    points, normals = curve.sampled(500, np.random.default_rng(0))
    radii = np.linalg.norm(points, axis=1)
    assert np.allclose((points * normals).sum(axis=1) / radii, np.where(radii > 1.5, 1, -1), atol=1e-3)


def test_what_a_store_keeps_of_a_curve_is_the_curve() -> None:
    curve = closed([ring(2.0), ring(1.0)])
    assert kind_of(curve) is KINDS[2]
    again = KINDS[2].read(csv_bytes(curve))
    assert again.volume == pytest.approx(curve.volume, rel=1e-11) and KINDS[2].pieces(again) == 2


def test_a_thinned_curve_encloses_nearly_as_much_and_keeps_its_holes():
    angles = np.linspace(0, 2 * np.pi, 5000, endpoint=False)
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    whole = closed([circle, 0.5 * circle, 0.1 * circle[::500]])
    thin = thinned(whole, 200)
    assert len(thin.vertices) < 250 and thin.pieces == 3
    assert thin.volume == pytest.approx(whole.volume, rel=0.01)
    assert thinned(thin, 1000) is thin
