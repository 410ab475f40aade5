"""Reading meshes of every format, repairing them, and turning down what bounds no body."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista
import trimesh

from naisr_model.data.meshes import check_mesh, read_mesh, repair_mesh
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
    mesh = repair_mesh(read_mesh(path))
    assert mesh.is_watertight
    assert len(mesh.faces) == len(ellipsoid.faces)
    np.testing.assert_allclose(mesh.bounds, ellipsoid.bounds, atol=1e-4)
    assert mesh.volume == pytest.approx(ellipsoid.volume, rel=1e-5)
    assert check_mesh(mesh) == ()


def test_polygons_and_upper_case_endings_are_read(tmp_path):
    box = pyvista.Box((0.0, 1.0, 0.0, 2.0, 0.0, 3.0), quads=True)
    box.save(tmp_path / "box.ply")
    path = (tmp_path / "box.ply").rename(tmp_path / "BOX.PLY")
    assert repair_mesh(read_mesh(path)).volume == pytest.approx(6.0)


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


def test_repair_merges_vertices_and_drops_useless_faces(ellipsoid):
    soup = trimesh.Trimesh(
        ellipsoid.triangles.reshape(-1, 3), np.arange(3 * len(ellipsoid.faces)).reshape(-1, 3), process=False
    )
    extra = np.vstack([soup.faces, [[0, 0, 1]], soup.faces[:1]])
    mesh = repair_mesh(trimesh.Trimesh(soup.vertices, extra, process=False))
    assert len(mesh.vertices) == len(ellipsoid.vertices)
    assert len(mesh.faces) == len(ellipsoid.faces)
    assert mesh.is_watertight


@pytest.mark.parametrize("turned", ["all", "some"])
def test_repair_turns_faces_outward(ellipsoid, turned):
    rng = np.random.default_rng(0)
    flip = np.ones(len(ellipsoid.faces), bool) if turned == "all" else rng.random(len(ellipsoid.faces)) < 0.7
    faces = np.where(flip[:, None], ellipsoid.faces[:, ::-1], ellipsoid.faces)
    mesh = repair_mesh(trimesh.Trimesh(ellipsoid.vertices, faces, process=False))
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
    mesh = repair_mesh(outer + cavity + neighbour)
    assert mesh.volume == pytest.approx(expected)
    assert [remark.topic for remark in check_mesh(mesh)] == ["components"]


def test_small_holes_are_bearable_and_said(ellipsoid):
    keep = np.random.default_rng(0).random(len(ellipsoid.faces)) > 0.01
    ellipsoid.update_faces(keep)
    (oddity,) = check_mesh(repair_mesh(ellipsoid))
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
        check_mesh(repair_mesh(ellipsoid))
    with pytest.raises(InputError, match="no faces"):
        check_mesh(trimesh.Trimesh())


def test_islands_between_missing_faces_keep_their_side(ellipsoid):
    keep = np.random.default_rng(1).random(len(ellipsoid.faces)) > 0.4
    ellipsoid.update_faces(keep)
    mesh = repair_mesh(ellipsoid)
    outward = np.einsum("ij,ij->i", mesh.face_normals, mesh.triangles_center - [3.0, -2.0, 50.0])
    assert (outward > 0).all()
