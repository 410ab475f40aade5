"""Known rigid motions are found again."""

from __future__ import annotations

import json

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from naisr_model.data.align import (
    Alignment,
    icp_alignment,
    landmark_alignment,
    propose,
    read_landmarks,
    rigid_transform,
)
from naisr_model.errors import Cancelled, InputError
from naisr_model.progress import Progress

NAMES = ("cords", "carina", "choana", "epiglottis", "tongue base")
POINTS = np.array([[0, 0, 0], [0, -5, -90], [5, 40, 80], [0, 12, 25], [-8, 20, 40]], dtype=float)


def named(points) -> dict[str, tuple[float, float, float]]:
    return {name: (float(x), float(y), float(z)) for name, (x, y, z) in zip(NAMES, points, strict=True)}


def moved(points, rng, degrees=25.0):
    rotation = Rotation.from_rotvec(np.radians(degrees) * rng.uniform(-1, 1, 3))
    return rotation.apply(points) + rng.uniform(-100, 100, 3)


def apply(matrix, points):
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def is_rigid(matrix) -> bool:
    rotation = matrix[:3, :3]
    return np.allclose(rotation @ rotation.T, np.eye(3)) and np.isclose(np.linalg.det(rotation), 1)


def test_none_leaves_the_scan_where_it_is():
    np.testing.assert_array_equal(rigid_transform(Alignment(), trimesh.Trimesh()), np.eye(4))


@pytest.mark.parametrize("origin", ["cords", ""])
def test_landmarks_undo_any_rigid_motion(origin):
    rng = np.random.default_rng(0)
    scans = [moved(POINTS, rng) for _ in range(6)]
    alignment = landmark_alignment([named(scan) for scan in scans], origin)
    reference = np.array([alignment.reference[name] for name in NAMES])
    for scan in scans:
        matrix = rigid_transform(alignment, trimesh.Trimesh(), named(scan))
        assert is_rigid(matrix)
        np.testing.assert_allclose(apply(matrix, scan), reference, atol=1e-6)
    np.testing.assert_allclose(reference[0] if origin else reference.mean(axis=0), 0, atol=1e-9)


def test_the_origin_is_exact_and_size_is_kept_when_shapes_differ():
    rng = np.random.default_rng(1)
    scans = [moved(POINTS * size + rng.normal(0, 2, POINTS.shape), rng) for size in (0.5, 0.8, 1.0, 1.3)]
    alignment = landmark_alignment([named(scan) for scan in scans], "cords")
    for scan in scans:
        found = apply(rigid_transform(alignment, trimesh.Trimesh(), named(scan)), scan)
        np.testing.assert_allclose(found[0], 0, atol=1e-9)
        assert np.linalg.norm(found[1]) == pytest.approx(np.linalg.norm(scan[1] - scan[0]))


def test_a_landmark_missing_from_one_scan_is_done_without():
    rng = np.random.default_rng(2)
    alignment = landmark_alignment([named(moved(POINTS, rng)) for _ in range(4)], "cords")
    scan = moved(POINTS, rng)
    some = {name: point for name, point in named(scan).items() if name != "choana"}
    whole = rigid_transform(alignment, trimesh.Trimesh(), named(scan))
    np.testing.assert_allclose(rigid_transform(alignment, trimesh.Trimesh(), some), whole, atol=1e-6)


def test_unusable_landmarks_are_explained():
    alignment = landmark_alignment([named(POINTS)], "cords")
    with pytest.raises(InputError, match="'cords'"):
        rigid_transform(alignment, trimesh.Trimesh(), {"carina": (0.0, 0.0, 0.0)})
    with pytest.raises(InputError, match="3 landmarks"):
        rigid_transform(alignment, trimesh.Trimesh(), {"cords": (0.0, 0.0, 0.0)})
    line = named(np.outer(np.arange(5), [1.0, 2.0, 3.0]))
    with pytest.raises(InputError, match="one line"):
        rigid_transform(alignment, trimesh.Trimesh(), line)
    with pytest.raises(InputError, match="'larynx'"):
        landmark_alignment([named(POINTS)], "larynx")
    with pytest.raises(InputError, match="3 landmarks that every subject has"):
        landmark_alignment([named(POINTS), {"cords": (0.0, 0.0, 0.0)}], "cords")


def test_landmark_files_are_read_or_explained(tmp_path):
    path = tmp_path / "landmarks.csv"
    path.write_text("name,x,y,z\ncords,1,2.5,-3\ncarina,0,0,0\n")
    assert read_landmarks(path) == {"cords": (1.0, 2.5, -3.0), "carina": (0.0, 0.0, 0.0)}
    path.write_text("name,x,y\ncords,1,2\n")
    with pytest.raises(InputError, match="name,x,y,z"):
        read_landmarks(path)
    path.write_text("name,x,y,z\ncords,1,two,3\n")
    with pytest.raises(InputError, match="numbers"):
        read_landmarks(path)
    with pytest.raises(InputError, match="cannot be read"):
        read_landmarks(tmp_path / "gone.csv")


def knobbly() -> trimesh.Trimesh:
    """A smooth body without symmetry."""
    mesh = trimesh.creation.icosphere(4, radius=1.0)
    x, y, z = mesh.vertices.T
    mesh.vertices *= (1 + 0.2 * x * y + 0.15 * z**2 * x + 0.1 * y * z)[:, None] * [30.0, 20.0, 45.0]
    return mesh


def test_icp_undoes_a_rigid_motion():
    body = knobbly()
    alignment = icp_alignment(body)
    rng = np.random.default_rng(4)
    scan = body.copy()
    scan.vertices = moved(body.vertices, rng, degrees=12.0)
    unmoved, found = rigid_transform(alignment, body), rigid_transform(alignment, scan)
    assert is_rigid(found)
    error_mm = np.linalg.norm(apply(found, scan.vertices) - apply(unmoved, body.vertices), axis=1)
    assert error_mm.max() < 0.2


def test_an_alignment_survives_json():
    alignment = landmark_alignment([named(POINTS)], "cords")
    assert Alignment.from_json(json.loads(json.dumps(alignment.to_json()))) == alignment


def branched() -> trimesh.Trimesh:
    """The knobbly body with a bend, so that neither end looks like the other."""
    mesh = knobbly()
    mesh.vertices[:, 1] += 0.01 * (mesh.vertices[:, 2] - 10) ** 2
    return mesh


def part(mesh: trimesh.Trimesh, which: str) -> trimesh.Trimesh:
    """Without the lowest or the highest third, or with a hole of a fifth of the faces."""
    height, middle = mesh.triangles_center[:, 2], mesh.triangles_center - mesh.triangles_center[0]
    kept = {
        "whole": height > -np.inf,
        "no bottom": height > mesh.bounds[0, 2] + np.ptp(mesh.bounds[:, 2]) / 3,
        "no top": height < mesh.bounds[1, 2] - np.ptp(mesh.bounds[:, 2]) / 3,
        "hole": np.linalg.norm(middle, axis=1) > np.quantile(np.linalg.norm(middle, axis=1), 0.2),
    }
    cut = trimesh.Trimesh(mesh.vertices, mesh.faces[kept[which]], process=False)
    cut.remove_unreferenced_vertices()
    return cut


@pytest.mark.parametrize(
    ("which", "degrees"), [("whole", 170.0), ("no bottom", 15.0), ("no top", 15.0), ("hole", 15.0)]
)
def test_icp_finds_whole_and_partial_shapes(which, degrees):
    body = branched()
    motion = np.eye(4)
    motion[:3, :3] = Rotation.from_rotvec(np.radians(degrees) * np.array([0.6, 0.0, 0.8])).as_matrix()
    motion[:3, 3] = [70.0, -30.0, 110.0]
    scan = part(body, which)
    scan.apply_transform(motion)
    before = scan.vertices.copy()
    proposal = propose("icp", scan, body)
    np.testing.assert_array_equal(scan.vertices, before)
    assert is_rigid(proposal.transform)
    back = apply(proposal.transform @ motion, body.vertices)
    assert np.linalg.norm(back - body.vertices, axis=1).max() < 1.0
    assert proposal.after_mm < 0.2 < 20 < proposal.before_mm


@pytest.mark.parametrize("which", ["no bottom", "no top", "cloud"])
def test_a_part_upside_down_is_righted_and_no_doubt_is_left(which):
    body, over = branched(), np.diag([1.0, -1.0, -1.0, 1.0])
    scan = part(body, "no top" if which == "cloud" else which)
    if which == "cloud":
        scan = trimesh.Trimesh(scan.vertices, np.zeros((0, 3), int), process=False)
    proposal = propose("icp", scan.apply_transform(over), body)
    back = apply(proposal.transform @ over, body.vertices)
    assert np.linalg.norm(back - body.vertices, axis=1).max() < 2.0
    assert proposal.turned_deg == pytest.approx(180, abs=3) and proposal.rival_deg is None


def test_of_orientations_that_do_as_well_the_files_own_is_kept_and_the_doubt_is_told():
    egg = trimesh.creation.icosphere(3).apply_scale([20.0, 24.0, 40.0])
    scan = egg.copy().apply_scale([1.0, 0.98, 1.04])
    scan.apply_transform(trimesh.transformations.rotation_matrix(np.radians(20), [1, 0, 0]))
    proposal = propose("icp", scan, egg)
    assert proposal.after_mm < 1.0 and proposal.turned_deg == pytest.approx(20, abs=2)
    assert proposal.rival_deg == pytest.approx(180, abs=5)


def test_an_alignment_can_be_stopped():
    polls = iter([False] * 5 + [True])
    with pytest.raises(Cancelled):
        propose("icp", knobbly(), branched(), progress=Progress(is_unwanted=lambda: next(polls)))


SHIFT_MM = np.array([-5.0, 8.0, -12.0])


def test_a_cloud_is_aligned_too():
    body = branched()
    cloud = trimesh.Trimesh(body.vertices - SHIFT_MM, np.zeros((0, 3), int), process=False)
    proposal = propose("icp", cloud, body)
    np.testing.assert_allclose(proposal.transform[:3, 3], SHIFT_MM, atol=0.5)


def test_none_proposes_no_motion_and_says_the_distance():
    outer, inner = trimesh.creation.icosphere(4, radius=30.0), trimesh.creation.icosphere(4, radius=27.0)
    proposal = propose("none", inner, outer)
    np.testing.assert_array_equal(proposal.transform, np.eye(4))
    assert proposal.before_mm == proposal.after_mm == pytest.approx(3.0, abs=0.05)
    assert proposal.landmarks_mm is None


def test_landmarks_are_proposed_with_their_residual():
    rng = np.random.default_rng(5)
    alignment = landmark_alignment([named(POINTS)], "cords")
    turn = Rotation.from_rotvec([0.3, -0.2, 0.9])
    off = POINTS + np.array([[0, 0, 0], [0, 0, 3], [0, 0, 0], [0, 0, 0], [0, 0, 0]])
    body = knobbly()
    scan = trimesh.Trimesh(turn.apply(body.vertices) + 50.0, body.faces, process=False)
    exact = propose("landmarks", scan, body, alignment, named(turn.apply(POINTS) + 50.0))
    assert exact.landmarks_mm == pytest.approx(0.0, abs=1e-4)
    assert exact.turned_deg == pytest.approx(np.degrees(turn.magnitude())) and exact.rival_deg is None
    assert exact.after_mm == pytest.approx(0.0, abs=1e-3)
    loose = propose("landmarks", scan, body, alignment, named(turn.apply(off) + 50.0))
    assert loose.landmarks_mm is not None and 0.1 < loose.landmarks_mm < 3 / np.sqrt(5) + 0.1
    with pytest.raises(InputError, match="not aligned by landmarks; choose icp or none"):
        propose("landmarks", scan, body, Alignment(), named(rng.random((5, 3))))
    with pytest.raises(InputError, match="'cords'"):
        propose("landmarks", scan, body, alignment)


FCSV = """# Markups fiducial file version = 4.11
# CoordinateSystem = {space}
# columns = id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID
vtkMRMLMarkupsFiducialNode_0,1.5,-2,3,0,0,0,1,1,1,0,cords,,
vtkMRMLMarkupsFiducialNode_1,4,5,6,0,0,0,1,1,1,0,carina,"a, b",
"""


def markups(space: str, **changes) -> str:
    points = [
        {"label": "cords", "position": [1.5, -2, 3], "positionStatus": "defined"},
        {"label": "carina", "position": [4, 5, 6], "positionStatus": "defined"},
        {"label": "unset", "position": [0, 0, 0], "positionStatus": "undefined"},
    ]
    markup = {"type": "Fiducial", "coordinateSystem": space, "coordinateUnits": "mm", "controlPoints": points}
    return json.dumps({"markups": [markup | changes]})


@pytest.mark.parametrize("name", ["points.fcsv", "points.mrk.json"])
@pytest.mark.parametrize("space", ["LPS", "RAS"])
def test_landmarks_of_slicer_come_in_the_space_of_the_mesh(tmp_path, name, space):
    path = tmp_path / name
    path.write_text(FCSV.format(space=space) if name.endswith("fcsv") else markups(space))
    as_written = {"cords": (1.5, -2.0, 3.0), "carina": (4.0, 5.0, 6.0)}
    turned = {"cords": (-1.5, 2.0, 3.0), "carina": (-4.0, -5.0, 6.0)}
    for wanted in ("LPS", "RAS"):
        assert read_landmarks(path, wanted) == (as_written if wanted == space else turned)


def test_numbered_spaces_of_old_files_are_known(tmp_path):
    (tmp_path / "old.fcsv").write_text(FCSV.format(space="0"))
    assert read_landmarks(tmp_path / "old.fcsv", "RAS")["cords"] == (1.5, -2.0, 3.0)


@pytest.mark.parametrize(
    "text",
    [
        "name;x;y;z\ncords;1,5;-2;3\ncarina;4;5;6\n",
        "Label,X [mm],Y [mm],Z [mm],note\ncords,1.5,-2,3,\ncarina,4,5,6,soft\n",
        "name\tx\ty\tz\ncords\t1.5\t-2\t3\ncarina\t4\t5\t6\n",
    ],
)
def test_tables_of_landmarks_are_read_in_every_dress(tmp_path, text):
    for encoding in ("utf-8-sig", "utf-16"):
        (tmp_path / "points.csv").write_bytes(text.encode(encoding))
        assert read_landmarks(tmp_path / "points.csv") == {
            "cords": (1.5, -2.0, 3.0),
            "carina": (4.0, 5.0, 6.0),
        }


BAD_LANDMARKS = {
    "twice.csv": ("name,x,y,z\na,1,2,3\nA,4,5,6\n", "'a' twice"),
    "same.csv": ("name,x,y,z\na,1,2,3\nb,1,2,3\n", "'a' and 'b' both at 1, 2, 3"),
    "far.csv": ("name,x,y,z\na,1,2,3\nb,1e6,2,3\n", "'b' is at 1e+06, 2, 3, beyond any scanner"),
    "nameless.csv": ("name,x,y,z\n,1,2,3\n", "without a name"),
    "doubt.csv": ('name,x,y,z\na,"1,234",2,3\n', "which may be 1.234 or 1234"),
    "image.fcsv": (FCSV.format(space="IJK"), "are in IJK"),
    "cut.fcsv": (FCSV.format(space="LPS")[:230], "cells only"),
    "image.mrk.json": (markups("IJK"), "are in IJK"),
    "feet.mrk.json": (markups("LPS", coordinateUnits="in"), "are in in"),
    "curve.mrk.json": (json.dumps({"markups": []}), "no file of one list of points"),
    "half.mrk.json": (markups("LPS")[:100], "no file of one list of points"),
    "deep.json": ("[" * 100_000, "no file of one list of points"),
}


@pytest.mark.parametrize("name", BAD_LANDMARKS)
def test_landmarks_that_cannot_be_used_are_explained(tmp_path, name):
    text, words = BAD_LANDMARKS[name]
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError) as caught:
        read_landmarks(tmp_path / name)
    assert words in str(caught.value) and name in str(caught.value)
