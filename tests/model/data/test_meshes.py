"""Reading meshes of every format, repairing them, and turning down what bounds no body."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista
import trimesh
from shapes import binary_stl, block

from naisr_model.data.meshes import (
    check_mesh,
    hole_areas_mm2,
    is_closed,
    mended_mesh,
    overlap_share,
    read_mesh,
    repair_mesh,
    sound_mesh,
)
from naisr_model.data.samples import signed_distance
from naisr_model.errors import InputError
from naisr_model.exports import mesh_bytes


@pytest.fixture
def ellipsoid() -> trimesh.Trimesh:
    mesh = trimesh.creation.icosphere(3, radius=10.0)
    mesh.apply_scale([1.0, 0.7, 0.4])
    mesh.apply_translation([3.0, -2.0, 50.0])
    return mesh


@pytest.mark.parametrize("suffix", [".stl", ".ply", ".obj", ".vtk", ".vtp", ".glb"])
def test_every_format_reads_back_the_same_surface(tmp_path, ellipsoid, suffix):
    path = tmp_path / f"shape{suffix}"
    if suffix == ".glb":
        path.write_bytes(mesh_bytes(ellipsoid, "glb"))
    else:
        pyvista.wrap(ellipsoid).save(path)
    mesh = repair_mesh(read_mesh(path))[0]
    assert mesh.is_watertight
    assert len(mesh.faces) == len(ellipsoid.faces)
    np.testing.assert_allclose(mesh.bounds, ellipsoid.bounds, atol=1e-4)
    assert mesh.volume == pytest.approx(ellipsoid.volume, rel=1e-5)
    assert check_mesh(mesh) == ()


def test_polygons_and_upper_case_endings_are_read(tmp_path):
    box = pyvista.Box((0.0, 1.0, 0.0, 2.0, 0.0, 3.0), quads=True)
    box.save(tmp_path / "box.ply")
    path = (tmp_path / "box.ply").rename(tmp_path / "BOX.PLY")
    assert repair_mesh(read_mesh(path))[0].volume == pytest.approx(6.0)


@pytest.mark.parametrize("suffix", [".stl", ".ply", ".obj", ".vtk", ".vtp", ".glb"])
def test_a_damaged_file_is_named(tmp_path, suffix, capfd):
    path = tmp_path / f"broken{suffix}"
    path.write_bytes(b"this is no mesh\n" * 3)
    with pytest.raises(InputError, match="broken"):
        read_mesh(path)


PLY = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
element face 2
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 1 0
0 0 1
3 0 1 2
{last}"""
VTK = """# vtk DataFile Version 3.0
a box
ASCII
DATASET {dataset}
POINTS 4 float
0 0 0 1 0 0 0 1 0 0 0 1
{cells} 2 9
3 0 1 2
4 0 1 2 {index}
{types}"""


@pytest.mark.parametrize("index", [4, -1, 10**9])
def test_faces_with_missing_vertices_are_rejected(tmp_path, index):
    grid = {"dataset": "UNSTRUCTURED_GRID", "cells": "CELLS", "types": "CELL_TYPES 2\n5\n9\n"}
    polygons = {"dataset": "POLYDATA", "cells": "POLYGONS", "types": ""}
    (tmp_path / "stray.ply").write_text(PLY.format(last=f"3 0 1 {index}\n"))
    (tmp_path / "polygons.vtk").write_text(VTK.format(index=index, **polygons))
    (tmp_path / "grid.vtk").write_text(VTK.format(index=index, **grid))
    for name in ("stray.ply", "polygons.vtk", "grid.vtk"):
        with pytest.raises(InputError, match=f"{name} has faces that name missing vertices; export it again"):
            read_mesh(tmp_path / name)


def test_a_file_that_was_cut_off_is_rejected(tmp_path, ellipsoid):
    ellipsoid.export(tmp_path / "whole.ply")
    content = (tmp_path / "whole.ply").read_bytes()
    for share in np.linspace(0.02, 0.99, 30):
        (tmp_path / "cut.ply").write_bytes(content[: int(share * len(content))])
        with pytest.raises(InputError, match=r"cut\.ply"):
            read_mesh(tmp_path / "cut.ply")
    (tmp_path / "cut.ply").write_text(PLY.format(last=""))
    with pytest.raises(InputError, match=r"cut\.ply is cut off"):
        read_mesh(tmp_path / "cut.ply")


def test_missing_and_foreign_files_are_named(tmp_path):
    with pytest.raises(InputError, match=r"gone\.stl does not exist"):
        read_mesh(tmp_path / "gone.stl")
    (tmp_path / "scan.dcm").write_bytes(b"no mesh")
    with pytest.raises(InputError, match=r"scan\.dcm is not one of"):
        read_mesh(tmp_path / "scan.dcm")


def test_a_point_cloud_has_no_faces(tmp_path):
    trimesh.PointCloud(np.random.default_rng(0).random((20, 3))).export(tmp_path / "cloud.ply")
    with pytest.raises(InputError, match="no faces"):
        read_mesh(tmp_path / "cloud.ply")


def test_vertices_that_are_not_numbers_are_rejected(tmp_path, ellipsoid):
    ellipsoid.vertices[3, 1] = np.nan
    ellipsoid.export(tmp_path / "nan.ply")
    with pytest.raises(InputError, match="not finite"):
        read_mesh(tmp_path / "nan.ply")


@pytest.mark.parametrize("gap_mm", [1e-6, 1e-5])
def test_triangles_that_rounding_took_apart_are_one_surface(ellipsoid, gap_mm):
    corners = ellipsoid.vertices[ellipsoid.faces].reshape(-1, 3)
    apart = corners + np.random.default_rng(0).uniform(-gap_mm, gap_mm, corners.shape)
    soup = trimesh.Trimesh(apart, np.arange(len(apart)).reshape(-1, 3), process=False)
    mesh = repair_mesh(soup)[0]
    assert mesh.is_watertight and len(mesh.vertices) == len(ellipsoid.vertices)
    assert mesh.volume == pytest.approx(ellipsoid.volume, rel=1e-4)


def test_a_gap_that_is_one_is_not_welded(ellipsoid):
    wide = trimesh.Trimesh(ellipsoid.vertices, ellipsoid.faces[1:], process=False)
    assert len(repair_mesh(wide)[0].faces) == len(ellipsoid.faces) - 1


def test_repair_merges_vertices_and_drops_useless_faces(ellipsoid):
    soup = trimesh.Trimesh(
        ellipsoid.triangles.reshape(-1, 3), np.arange(3 * len(ellipsoid.faces)).reshape(-1, 3), process=False
    )
    extra = np.vstack([soup.faces, [[0, 0, 1]], soup.faces[:1]])
    mesh = repair_mesh(trimesh.Trimesh(soup.vertices, extra, process=False))[0]
    assert len(mesh.vertices) == len(ellipsoid.vertices)
    assert len(mesh.faces) == len(ellipsoid.faces)
    assert mesh.is_watertight


@pytest.mark.parametrize("turned", ["all", "some"])
def test_repair_turns_faces_outward(ellipsoid, turned):
    rng = np.random.default_rng(0)
    flip = np.ones(len(ellipsoid.faces), bool) if turned == "all" else rng.random(len(ellipsoid.faces)) < 0.7
    faces = np.where(flip[:, None], ellipsoid.faces[:, ::-1], ellipsoid.faces)
    mesh = repair_mesh(trimesh.Trimesh(ellipsoid.vertices, faces, process=False))[0]
    assert mesh.volume == pytest.approx(ellipsoid.volume)
    outward = np.einsum("ij,ij->i", mesh.face_normals, mesh.triangles_center - mesh.centroid)
    assert (outward > 0).all()


def test_an_inside_out_neighbour_is_turned_but_a_cavity_is_kept():
    outer, cavity = trimesh.creation.icosphere(2, radius=10.0), trimesh.creation.icosphere(2, radius=4.0)
    neighbour = trimesh.creation.icosphere(2, radius=3.0)
    neighbour.apply_translation([20.0, 0.0, 0.0])
    expected = outer.volume - cavity.volume + neighbour.volume
    cavity.invert()
    neighbour.invert()
    mesh = repair_mesh(outer + cavity + neighbour)[0]
    assert mesh.volume == pytest.approx(expected)
    assert [remark.topic for remark in check_mesh(mesh)] == ["components"]


def test_small_holes_are_bearable_and_said(ellipsoid):
    keep = np.random.default_rng(0).random(len(ellipsoid.faces)) > 0.01
    ellipsoid.update_faces(keep)
    (oddity,) = check_mesh(repair_mesh(ellipsoid)[0])
    assert "open edges" in oddity.text


def test_what_bounds_no_body_is_rejected(ellipsoid):
    sheet = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    with pytest.raises(InputError, match="open"):
        check_mesh(sheet)
    doubled = trimesh.Trimesh(sheet.vertices, np.vstack([sheet.faces, sheet.faces[:, ::-1]]), process=False)
    with pytest.raises(InputError, match="no volume"):
        check_mesh(doubled)
    ellipsoid.update_faces(ellipsoid.triangles_center[:, 2] < 50.0)
    with pytest.raises(InputError, match="open"):
        check_mesh(repair_mesh(ellipsoid)[0])
    with pytest.raises(InputError, match="no faces"):
        check_mesh(trimesh.Trimesh())


def test_islands_between_missing_faces_keep_their_side(ellipsoid):
    keep = np.random.default_rng(1).random(len(ellipsoid.faces)) > 0.4
    ellipsoid.update_faces(keep)
    mesh = repair_mesh(ellipsoid)[0]
    outward = np.einsum("ij,ij->i", mesh.face_normals, mesh.triangles_center - [3.0, -2.0, 50.0])
    assert (outward > 0).all()


# --- closedness ---------------------------------------------------------------------------------


def ball(
    radius: float, centre: tuple[float, float, float] = (0.0, 0.0, 0.0), fineness: int = 3
) -> trimesh.Trimesh:
    mesh = trimesh.creation.icosphere(fineness, radius=radius)
    mesh.apply_translation(centre)
    return mesh


def with_a_third_corner_on_an_edge(mesh: trimesh.Trimesh, filled: bool) -> trimesh.Trimesh:
    """A corner in the middle of an edge of one of its two faces; the slit has a face without area or none."""
    a, b, c = mesh.faces[0]
    middle = mesh.vertices[[a, b]].mean(axis=0)
    new = len(mesh.vertices)
    faces = [[a, new, c], [new, b, c], *([[a, b, new]] if filled else [])]
    return trimesh.Trimesh(
        np.vstack([mesh.vertices, middle]), np.vstack([mesh.faces[1:], faces]), process=False
    )


@pytest.mark.parametrize("filled", [True, False])
def test_slits_do_not_open_a_surface(filled):
    mesh = repair_mesh(with_a_third_corner_on_an_edge(block(), filled))[0]
    assert is_closed(mesh) and hole_areas_mm2(mesh).sum() == pytest.approx(0, abs=1e-9)
    assert mesh.volume == pytest.approx(240_000)
    assert [remark.severity for remark in check_mesh(mesh)] == ([] if filled else ["fine"])


def test_blocks_that_touch_along_an_edge_are_closed():
    other = block()
    other.apply_translation([40.0, 60.0, 0.0])
    mesh = repair_mesh(block() + other)[0]
    assert not mesh.is_watertight, "four faces meet at an edge"
    assert is_closed(mesh) and mesh.volume == pytest.approx(480_000) and not len(check_mesh(mesh))


def test_a_missing_face_is_a_hole_however_small_the_others():
    mesh = ball(40.0)
    mesh.update_faces(np.arange(len(mesh.faces)) > 3)
    assert not is_closed(repair_mesh(mesh)[0])
    (remark,) = check_mesh(repair_mesh(mesh)[0])
    assert (remark.severity, remark.topic) == ("look", "open") and " 0.0 %" not in remark.text


# --- overlap ------------------------------------------------------------------------------------

BALL_MM3 = 4 / 3 * np.pi * 40.0**3


def inverted(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    mesh = mesh.copy()
    mesh.invert()
    return mesh


def wall() -> trimesh.Trimesh:
    """A sheet across the middle of :func:`block`, whose corners are among the block's."""
    y, z = np.meshgrid(np.linspace(-30, 30, 9), np.linspace(-50, 50, 9), indexing="ij")
    index = np.arange(81).reshape(9, 9)
    a, b, c, d = (part.ravel() for part in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    points = np.stack([0 * y, y, z], axis=-1).reshape(-1, 3)
    return trimesh.Trimesh(points, np.vstack([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]), process=False)


def test_overlapping_pieces_become_their_union():
    """Two balls of 40 mm, 40 mm apart: the lens that they share counts once."""
    lens_mm3 = np.pi * (4 * 40 + 40) * (2 * 40 - 40) ** 2 / 12
    mesh, remarks = mended_mesh(ball(40.0, fineness=4) + ball(40.0, (40.0, 0.0, 0.0), fineness=4))
    assert mesh.volume == pytest.approx(2 * BALL_MM3 - lens_mm3, rel=0.005) and is_closed(mesh)
    assert [(remark.severity, remark.topic) for remark in remarks] == [("look", "overlap")]
    # On the plane where they meet, the surface is as far as the circle of the crease.
    assert signed_distance(mesh, np.array([[20.0, 0.0, 0.0]]))[0] == pytest.approx(-np.sqrt(1200), abs=0.5)
    assert overlap_share(mesh) == 0 and check_mesh(mesh) == ()


@pytest.mark.parametrize("inner", [40.0 - 1e-4, 20.0])
def test_sheets_in_each_other_leave_the_outer_one(inner):
    mesh, remarks = mended_mesh(ball(40.0, fineness=4) + ball(inner, fineness=4))
    assert mesh.volume == pytest.approx(BALL_MM3, rel=0.005)
    assert signed_distance(mesh, np.zeros((1, 3)))[0] == pytest.approx(-40, abs=0.2)
    (remark,) = remarks
    assert (remark.severity, remark.topic) == ("look", "overlap") and "if that is a cavity" in remark.text


def test_a_cavity_stays_and_is_no_overlap():
    mesh, remarks = mended_mesh(ball(40.0) + inverted(ball(20.0)))
    assert remarks == () and mesh.volume == pytest.approx(ball(40.0).volume - ball(20.0).volume)


WALLS = {
    "one sheet": block() + wall(),
    "both sides": block() + wall() + inverted(wall()),
    "floating": block() + wall().apply_scale(0.5),
}


@pytest.mark.parametrize("kind", WALLS)
def test_walls_inside_are_left_out(kind):
    mesh = mended_mesh(WALLS[kind])[0]
    assert len(mesh.faces) == len(block().faces) and is_closed(mesh)
    assert mesh.volume == pytest.approx(240_000)
    assert signed_distance(mesh, np.array([[1.0, 0.0, 0.0]]))[0] == pytest.approx(-19)


def test_chambers_that_share_a_wall_become_one_body():
    other = block()
    other.apply_translation([40.0, 0.0, 0.0])
    mesh = mended_mesh(block() + other)[0]
    assert mesh.volume == pytest.approx(480_000, rel=0.005)
    assert signed_distance(mesh, np.array([[20.0, 0.0, 0.0]]))[0] == pytest.approx(-30, abs=0.5)


def test_faces_that_are_written_twice_or_from_both_sides_count_once():
    for twice in (block() + block(), block() + inverted(block())):
        mesh, remarks = mended_mesh(twice)
        assert remarks == () and mesh.is_watertight and abs(mesh.volume) == pytest.approx(240_000)


def test_sound_shapes_have_no_overlap(ellipsoid):
    for mesh in (ellipsoid, block(), trimesh.creation.torus(50.0, 20.0)):
        assert overlap_share(mesh) == 0


# --- the whole gate -----------------------------------------------------------------------------


def test_debris_is_told_with_its_distance(tmp_path):
    path = tmp_path / "scan.stl"
    path.write_bytes(binary_stl(block() + ball(1.0, (920.0, 0.0, 0.0), 1)))
    mesh, *_, remarks = sound_mesh(path)
    assert mesh.volume == pytest.approx(240_000, rel=1e-3)
    (far,) = [remark for remark in remarks if remark.topic == "debris"]
    assert far.severity == "look" and "899 to 901 mm from the main piece" in far.text
    near = block() + ball(1.0, (30.0, 0.0, 0.0), 1)
    path.write_bytes(binary_stl(near))
    assert [remark.topic for remark in sound_mesh(path).remarks] == ["components"]


def test_a_stated_space_is_told(tmp_path):
    path = tmp_path / "scan.stl"
    path.write_bytes(binary_stl(block(), header=b"3D Slicer output. SPACE=RAS"))
    file = sound_mesh(path)
    assert file.space == "RAS" and [remark.topic for remark in file.remarks] == ["space"]


def test_a_spike_is_told():
    mesh = ball(40.0)
    mesh.vertices[7] *= 50
    (remark,) = check_mesh(repair_mesh(mesh)[0])
    assert (remark.severity, remark.topic) == (
        "look",
        "spikes",
    ) and "1 vertices lie up to 2e+03 mm" in remark.text


def test_faces_all_over_have_no_outside(tmp_path):
    """Corners in another order: what a file is whose vertices were shifted by some bytes."""
    mesh = ball(40.0)
    mesh.vertices = np.random.default_rng(0).permutation(mesh.vertices)
    with pytest.raises(InputError, match="cross each other all over"):
        mended_mesh(mesh)
