"""Curves of a user's own: what is read of them, and what is refused with a sentence."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from skimage import io

from naisr_model.data.curves import is_curve_file, labels_in, sound_curve
from naisr_model.errors import InputError

SQUARE = [(0.0, 0.0), (30.0, 0.0), (30.0, 20.0), (0.0, 20.0)]


def sides(corners: list[tuple[float, float]], steps: int = 5) -> np.ndarray:
    """Points along a polygon."""
    begin, end = np.array(corners), np.roll(corners, -1, axis=0)
    return (
        begin[:, None] + (end - begin)[:, None] * np.linspace(0, 1, steps, endpoint=False)[:, None]
    ).reshape(-1, 2)


def written(path: Path, points: np.ndarray, header: str = "x,y") -> Path:
    path.write_text("\n".join([header, *(",".join(map(repr, row)) for row in points.tolist())]) + "\n")
    return path


def test_text_of_points_is_read_either_way_round_in_the_unit_that_it_states(tmp_path) -> None:
    points = sides(SQUARE)
    for name, order, header, factor in (
        ("left.csv", points, "x,y", 1),
        ("right.csv", points[::-1], "x [cm],y [cm]", 10),
    ):
        path = written(tmp_path / name, order, header)
        assert is_curve_file(path)
        file = sound_curve(path)
        assert file.curve.volume == pytest.approx(600 * factor**2)
        assert any("unit" in one.text or "cm" in one.text for one in file.remarks)


def test_pieces_are_holes_where_they_lie_inside(tmp_path) -> None:
    hole = 5 + sides(SQUARE) / 4
    rows = [f"{x},{y},{piece}" for piece, loop in enumerate((sides(SQUARE), hole)) for x, y in loop.tolist()]
    path = tmp_path / "holed.csv"
    path.write_text("\n".join(["x,y,piece", *rows]))
    file = sound_curve(path)
    assert file.curve.volume == pytest.approx(600 * 15 / 16)
    assert any("2 pieces" in one.text for one in file.remarks)


def test_drawings_are_read_with_their_curves_transforms_and_size(tmp_path) -> None:
    kappa = 4 / 3 * (math.sqrt(2) - 1)
    arc = f"M1,0 C1,{kappa} {kappa},1 0,1 S-1,{kappa} -1,0 S-{kappa},-1 0,-1 S1,-{kappa} 1,0 Z"
    path = tmp_path / "disc.svg"
    path.write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" width="40mm" height="40mm" viewBox="0 0 4 4">'
        f'<g transform="translate(2 2)"><path d="{arc}"/></g></svg>'
    )
    file = sound_curve(path)
    assert file.unit_mm == 1.0 and file.curve.volume == pytest.approx(math.pi * 100, rel=0.01)
    low, high = file.curve.bounds
    assert low == pytest.approx([10, -30], abs=0.01) and high == pytest.approx([30, -10], abs=0.01)


def test_a_label_of_an_image_is_outlined_upright(tmp_path) -> None:
    pixels = np.zeros((40, 60), np.uint8)
    pixels[5:15, 10:30], pixels[25:35, 40:45] = 1, 2
    io.imsave(tmp_path / "labels.png", pixels, check_contrast=False)
    path = tmp_path / "labels.png"
    assert set(labels_in(path)) == {1, 2}
    with pytest.raises(InputError, match="holds the labels 1, 2; choose one"):
        sound_curve(path)
    curve = sound_curve(path, 1).curve
    assert curve.volume == pytest.approx(200, abs=1)
    assert curve.bounds.mean(axis=0) == pytest.approx([20, 30])


@pytest.mark.parametrize(
    ("points", "said"),
    [
        (sides(SQUARE)[:12], "is open"),
        (sides([SQUARE[0], SQUARE[2], SQUARE[1], SQUARE[3]]), "crosses itself near"),
        (sides(SQUARE, 1), "4 points that differ"),
        (np.append(sides(SQUARE), [[1e300, 0]], axis=0), "larger than anything"),
    ],
)
def test_what_bounds_nothing_is_refused(points: np.ndarray, said: str, tmp_path) -> None:
    with pytest.raises(InputError, match=said):
        sound_curve(written(tmp_path / "bad.csv", points))


@pytest.mark.parametrize(
    ("inside", "said"),
    [
        ('<circle r="3"/>', "draws a <circle>; convert"),
        ('<path d="M0,0 A1 1 0 0 0 3 3 Z"/>', "convert arcs"),
        ('<path d="M0,0 L1"/>', "ends early"),
        ("", "draws no path"),
    ],
)
def test_drawings_that_are_no_outlines_are_refused(inside: str, said: str, tmp_path) -> None:
    path = tmp_path / "bad.svg"
    path.write_text(f"<svg xmlns='http://www.w3.org/2000/svg'>{inside}</svg>")
    with pytest.raises(InputError, match=said):
        sound_curve(path)
