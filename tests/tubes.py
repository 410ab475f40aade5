"""Tubes with caps whose length and cross-sections are known in closed form."""

from __future__ import annotations

import numpy as np
import trimesh
from numpy.typing import NDArray

AROUND = 48
CIRCLE = AROUND * np.sin(2 * np.pi / AROUND) / 2
"""Area of the polygon that stands for a circle of radius 1."""


def straight(radii: NDArray[np.float64], length: float = 100.0) -> trimesh.Trimesh:
    """Along z from 0, with these radii at even distances."""
    heights = np.linspace(0.0, length, len(radii))
    zeros, ones = np.zeros_like(heights), np.ones_like(heights)
    return _swept(np.stack([zeros, zeros, heights], axis=1), np.stack([ones, zeros, zeros], axis=1), radii)


def bent(radius: float, about: float, angle: float) -> trimesh.Trimesh:
    """Part of a torus about the y axis."""
    angles = np.linspace(0.0, angle, 300)
    out = np.stack([np.cos(angles), np.zeros(300), np.sin(angles)], axis=1)
    return _swept(about * out, out, np.full(300, radius))


def _swept(centres: NDArray, normals: NDArray, radii: NDArray) -> trimesh.Trimesh:
    tangents = np.gradient(centres, axis=0)
    binormals = np.cross(tangents / np.linalg.norm(tangents, axis=1, keepdims=True), normals)
    turn = np.linspace(0, 2 * np.pi, AROUND, endpoint=False)
    spokes = np.cos(turn)[:, None] * normals[:, None] + np.sin(turn)[:, None] * binormals[:, None]
    rings = centres[:, None] + radii[:, None, None] * spokes
    number = np.arange(len(centres) * AROUND).reshape(-1, AROUND)
    here, there = number[:-1], number[1:]
    after, beyond = np.roll(here, -1, axis=1), np.roll(there, -1, axis=1)
    tips = number.size + np.arange(2)
    bottom, top = number[0], number[-1]
    faces = [
        np.stack([here, after, there], axis=-1).reshape(-1, 3),
        np.stack([after, beyond, there], axis=-1).reshape(-1, 3),
        np.stack([np.roll(bottom, -1), bottom, np.full(AROUND, tips[0])], axis=1),
        np.stack([top, np.roll(top, -1), np.full(AROUND, tips[1])], axis=1),
    ]
    points = np.vstack([rings.reshape(-1, 3), centres[[0, -1]]])
    return trimesh.Trimesh(points, np.concatenate(faces), process=False)
