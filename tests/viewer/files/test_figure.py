"""The matrix for print, against what ellipsoids look like."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from naisr_model.errors import Cancelled
from naisr_model.progress import Progress
from naisr_model.shapes.curve import closed
from naisr_viewer.control.jobs import ExportReport, exporting_matrix
from naisr_viewer.files.figure import CELL_IN, DOTS_PER_INCH, OUTLINE_PT, as_seen, shape_image
from naisr_viewer.files.matrix import planned_matrix
from naisr_viewer.panels.kinds import request_for, visible_panels
from naisr_viewer.state.camera import FROM_THE_FRONT, Camera
from naisr_viewer.state.explorer import ExplorerState, opened
from naisr_viewer.state.layouts import FULL_SHAPE, Layout
from naisr_viewer.state.matrix import Matrix, side_of
from naisr_viewer.state.requests import ExportChoice, Origin, SurfaceRequest, SurfaceResult
from naisr_viewer.views.colours import printed_colours

ABOVE = Camera((5.0, 5.0, 90.0), (5.0, 5.0, 0.0), (0.0, -1.0, 0.0), (1.0, 1.0))


@pytest.fixture
def state(card) -> ExplorerState:
    """Two values of each covariate."""
    few = Matrix(side_of(card, "age", 2), side_of(card, "weight", 2))
    return replace(opened(ExplorerState(), card), layout=Layout.MATRIX, matrix=few)


def choice_of(state: ExplorerState, folder: Path, figure: str) -> ExportChoice:
    return ExportChoice(visible_panels(state), "stl", 128, folder, figure)


def test_right_up_and_towards_the_eye():
    """x points left in the body, y back and z up; in front of it the left side is seen at the right."""
    axes = np.eye(3)
    np.testing.assert_allclose(as_seen(axes, FROM_THE_FRONT), [[1, 0, 0], [0, 0, -1], [0, 1, 0]], atol=1e-12)
    np.testing.assert_allclose(as_seen(axes, ABOVE), [[-1, 0, 0], [0, -1, 0], [0, 0, 1]], atol=1e-12)


def test_what_a_curve_encloses_is_filled_without_its_holes():
    angles = np.linspace(0, 2 * np.pi, 200, endpoint=False)
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    ring = closed([40 * circle, 20 * circle])
    request = SurfaceRequest(Path("a"), FULL_SHAPE, (), 128)
    shape = SurfaceResult(
        request,
        ring.vertices.astype(np.float32),
        ring.vertex_normals.astype(np.float32),
        ring.faces,
        ring.volume,
        0.0,
        Origin.NETWORK,
    )
    image = shape_image(shape, "#4080c0", FROM_THE_FRONT, (-60.0, 60.0, -60.0, 60.0)).astype(float)
    mm_a_dot = 120 / image.shape[0]
    covered = image[..., 3].sum() / 255 * mm_a_dot**2
    line_mm = OUTLINE_PT / 72 / CELL_IN * 120  # half of it lies outside, on both sides of the ring
    assert covered == pytest.approx(np.pi * (40**2 - 20**2) + np.pi * (40 + 20) * line_mm, rel=0.01)
    middle, flesh = image[image.shape[0] // 2, [image.shape[1] // 2, round(0.75 * image.shape[1])]]
    assert middle[3] == 0 and flesh[:3].round().tolist() == [0x40, 0x80, 0xC0]


@pytest.mark.parametrize(("camera", "half_axes"), [(FROM_THE_FRONT, (0, 2)), (ABOVE, (0, 1))])
def test_a_shape_covers_the_ellipse_that_it_is_seen_as_and_is_brightest_in_the_middle(
    engine, state, camera, half_axes
):
    surface = engine.surface(request_for(state, visible_panels(state)[0], 128))
    image = shape_image(surface, "#4080c0", camera, (-60.0, 60.0, -60.0, 60.0)).astype(float)
    dots = round(CELL_IN * DOTS_PER_INCH)
    assert image.shape == (dots, dots, 4)
    first, second = (np.array((20.0, 20.0, 45.0)) * dots / 120)[list(half_axes)]
    assert image[..., 3].sum() / 255 == pytest.approx(np.pi * first * second, rel=0.01)
    middle, edge = image[dots // 2, dots // 2], image[dots // 2, dots // 2 - round(0.95 * first)]
    assert middle[:3].sum() > 1.5 * edge[:3].sum() and middle[2] > middle[1] > middle[0]


def test_the_figure_has_its_words_as_words_and_a_mesh_for_each_cell(engine, atlas, state, tmp_path):
    choice = choice_of(state, tmp_path, "svg")
    plan = planned_matrix(state, choice)
    reports: list[ExportReport] = []
    exporting_matrix(engine, state, plan, choice, printed_colours(state))(reports.append, Progress())
    assert "a figure and 9 surfaces as STL" in reports[0].sentence
    svg = plan.figure.read_text(encoding="utf-8")
    words = set(re.findall(r"<text[^>]*>([^<]*)</text>", svg)) | set(re.findall(r"<tspan[^>]*>([^<]*)", svg))
    months = {f"{value:.0f} months" for value in state.matrix.across.values}
    assert months | {"Age", "Weight", "Age only", "Weight only", "template", "outside the data"} <= words
    assert len(re.findall("<image", svg)) == 9
    record = json.loads(plan.record.read_text(encoding="utf-8"))
    assert {path.name for path in plan.figure.parent.iterdir()} == {
        *(cell["file"] for cell in record["cells"]),
        *(plan.figure.name, plan.record.name),
    }
    for cell in record["cells"]:
        given = {name: each["value"] for name, each in cell["covariates"].items()}
        mesh = trimesh.load_mesh(plan.figure.parent / cell["file"])
        assert mesh.volume / 1000 == pytest.approx(atlas.volume_cm3(**given), rel=0.02)
        assert f"{cell['volume_cm3']:.1f} cm³" in words
    views = [cell["view"] for cell in record["cells"]]
    assert views[:4] == ["Template", "Age only", "Age only", "Weight only"] and set(views[4:]) == {
        "Full shape",
        "Weight only",
    }
    pale = {(cell["column"], cell["row"]) for cell in record["cells"] if cell["outside_the_data"]}
    assert {(2, 1), (1, 2)} <= pale and not {(1, 1), (2, 2)} & pale  # weight grows with age


def test_the_same_figure_is_the_same_file(engine, state, tmp_path):
    contents = []
    for name in ("one", "two"):
        choice = choice_of(state, tmp_path / name, "pdf")
        plan = planned_matrix(state, choice)
        exporting_matrix(engine, state, plan, choice, printed_colours(state))(lambda _: None, Progress())
        contents.append(plan.figure.read_bytes())
        assert set(plan.in_the_way) == set(plan.figure.parent.iterdir())
    assert contents[0] == contents[1] and contents[0].startswith(b"%PDF")


@pytest.mark.parametrize("after", [3, 18])
def test_nothing_is_left_of_what_nobody_waits_for(engine, state, tmp_path, after):
    """Cancelled among the surfaces, and while the figure is drawn."""
    asked = iter(range(1000))
    progress = Progress(is_unwanted=lambda: next(asked) > after)
    choice = choice_of(state, tmp_path, "svg")
    job = exporting_matrix(engine, state, planned_matrix(state, choice), choice, printed_colours(state))
    with pytest.raises(Cancelled):
        job(lambda _: None, progress)
    assert not (tmp_path / "ellipsoid-matrix_age_weight").exists()
