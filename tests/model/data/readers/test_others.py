"""OBJ, VTK, VTP and GLB: whole, cut off, lines alone, compressed, and in the format's own unit and axes."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista
import trimesh
from shapes import block, glb, legacy_vtk

from naisr_model.data.meshes import read_mesh
from naisr_model.data.patients import read_patient
from naisr_model.errors import InputError
from naisr_model.exports import FORMATS, mesh_bytes

BLOCK = block()
POINTS, FACES = np.asarray(BLOCK.vertices), np.asarray(BLOCK.faces).tolist()


@pytest.mark.parametrize("binary", [False, True])
@pytest.mark.parametrize("version", ["3", "5"])
def test_a_legacy_file_that_was_cut_off_is_refused_wherever(tmp_path, binary, version, capfd):
    path = tmp_path / "block.vtk"
    if version == "3":
        path.write_bytes(legacy_vtk(POINTS, {"POLYGONS": FACES}, binary))
    else:
        pyvista.wrap(BLOCK).save(path, binary=binary)
    assert read_mesh(path).volume == pytest.approx(240_000, rel=1e-6)
    content = path.read_bytes().rstrip()
    end = content.rindex(b"METADATA") - 2 if b"METADATA" in content[-300:] else len(content)
    for share in np.linspace(0.03, 1, 25, endpoint=False):
        path.write_bytes(content[: int(share * end)])
        with pytest.raises(InputError, match=r"block\.vtk .*(cut off|names .* points and nothing|announces)"):
            read_patient(path)
    assert capfd.readouterr() == ("", "")


def test_strips_polygons_and_triangles_of_a_legacy_file_are_read(tmp_path):
    corners = [(x, y, z) for z in (0, 3) for y in (0, 2) for x in (0, 1)]
    polygons = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3]]
    strips = [[0, 4, 2, 6], [1, 3, 5, 7]]
    for binary in (False, True):
        path = tmp_path / "box.vtk"
        path.write_bytes(legacy_vtk(corners, {"POLYGONS": polygons, "TRIANGLE_STRIPS": strips}, binary))
        mesh = read_mesh(path)
        assert mesh.is_watertight and abs(mesh.volume) == pytest.approx(6.0)


def test_an_xml_file_that_was_cut_off_is_refused_wherever(tmp_path, capfd):
    path = tmp_path / "block.vtp"
    for binary in (False, True):
        pyvista.wrap(BLOCK).save(path, binary=binary)
        content = path.read_bytes().rstrip()
        for share in np.linspace(0.1, 1, 15, endpoint=False):
            path.write_bytes(content[: int(share * len(content))])
            with pytest.raises(InputError, match=r"block\.vtp is (cut off|no VTP|an XML)"):
                read_patient(path)
    assert capfd.readouterr() == ("", "")


def test_an_obj_file_is_compared_with_what_its_comments_announce(tmp_path):
    path = tmp_path / "block.obj"
    lines = [f"# Vertices: {len(POINTS)}", f"# Faces: {len(FACES)}"]
    lines += ["v {} {} {} # a point".format(*point) for point in POINTS]
    lines += ["f {}//1 {}//1 {}//1".format(*(np.array(face) + 1)) for face in FACES]
    path.write_text("\n".join(lines) + "\n")
    assert read_mesh(path).volume == pytest.approx(240_000)
    path.write_text("\n".join(lines[:-300]) + "\n")
    with pytest.raises(InputError, match="announces 768 faces and holds 468"):
        read_mesh(path)
    path.write_text("\n".join(lines[:-1]) + "\nf 1 2\n")
    with pytest.raises(InputError, match=r"line \d+ \('f 1 2'\) is not understood"):
        read_mesh(path)
    path.write_text("\n".join(lines).replace("v 20.0 ", "v 20,0 ", 1))
    with pytest.raises(InputError, match=r"line \d+ \('v 20,0 .* is not understood"):
        read_mesh(path)


def test_an_obj_file_counts_backwards_and_goes_on_over_lines(tmp_path):
    path = tmp_path / "box.obj"
    corners = [(x, y, z) for z in (0, 3) for y in (0, 2) for x in (0, 1)]
    sides = [
        [-8, -6, -5, -7],
        [-4, -3, -1, -2],
        [-8, -7, -3, -4],
        [-6, -2, -1, -5],
        [-8, -4, -2, -6],
        [2, 4, 8, 6],
    ]
    lines = ["v {} {} {} 1.0".format(*corner) for corner in corners] + [
        "f {} {} \\\n {} {}".format(*side) for side in sides
    ]
    path.write_text("mtllib none.mtl\no box\n" + "\n".join(lines))
    mesh = read_mesh(path)
    assert mesh.is_watertight and abs(mesh.volume) == pytest.approx(6.0)


def test_lines_alone_are_no_surface(tmp_path, capfd):
    line = np.stack([np.linspace(0, 100, 60), np.sin(np.arange(60)), np.cos(np.arange(60))], axis=1)
    pyvista.lines_from_points(line).save(tmp_path / "line.vtp")
    pyvista.lines_from_points(line).save(tmp_path / "line.vtk")
    (tmp_path / "line.obj").write_text("".join("v {} {} {}\n".format(*p) for p in line) + "l 1 2 3 4\n")
    for mode in (1, 2, 3):
        (tmp_path / f"line{mode}.glb").write_bytes(glb(line / 1000, mode=mode))
    for path in sorted(tmp_path.iterdir()):
        with pytest.raises(InputError, match=f"{path.name} holds lines, no surface"):
            read_patient(path)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("more", "match"),
    [
        (
            {"extensionsRequired": ["KHR_draco_mesh_compression"]},
            "is compressed with Draco; export it without",
        ),
        ({"extensionsUsed": ["EXT_meshopt_compression"]}, "is compressed with meshopt; export it without"),
        ({"extensionsRequired": ["KHR_mesh_quantization"]}, "needs the glTF extension KHR_mesh_quantization"),
        ({"meshes": []}, "holds no scene with a surface in it; export the surface again"),
        ({"scenes": [], "nodes": []}, "holds no scene with a surface in it"),
        ({"accessors": []}, "is a damaged GLB file and cannot be read; copy or export it again"),
    ],
)
def test_a_glb_that_is_not_read_says_why(tmp_path, more, match):
    more = {**more, **({"nodes": [{}]} if "meshes" in more else {})}
    (tmp_path / "scan.glb").write_bytes(glb(POINTS / 1000, FACES, **more))
    with pytest.raises(InputError, match=rf"scan\.glb .*{match}"):
        read_patient(tmp_path / "scan.glb")


def test_a_glb_that_was_cut_off_says_so(tmp_path):
    content = glb(POINTS / 1000, FACES)
    for share in (0.001, 0.02, 0.5, 0.99):
        (tmp_path / "scan.glb").write_bytes(content[: max(13, int(share * len(content)))])
        with pytest.raises(InputError, match="cut off: it announces"):
            read_patient(tmp_path / "scan.glb")


def test_a_glb_is_in_metres_with_y_up(tmp_path):
    """A child 1 m tall, 0.3 m wide, with its face, 0.2 m deep, towards +z as the format has it."""
    child = trimesh.creation.box((0.3, 1.0, 0.2))
    child.apply_translation([0.0, 0.5, 0.0])
    child.vertices[np.asarray(child.vertices)[:, 2] > 0, 0] *= 0.5
    (tmp_path / "child.glb").write_bytes(glb(child.vertices, child.faces))
    patient = read_patient(tmp_path / "child.glb")
    np.testing.assert_allclose(patient.mesh_mm.bounds, [[-150, -100, 0], [150, 100, 1000]], atol=1e-3)
    front = np.asarray(patient.mesh_mm.vertices)[:, 1] < 0
    assert np.abs(np.asarray(patient.mesh_mm.vertices)[front, 0]).max() == pytest.approx(75, abs=1e-3)
    assert patient.mesh_mm.volume == pytest.approx(child.volume * 1e9)
    (remark,) = patient.remarks
    assert (
        remark.severity == "fine"
        and "metres with y up" in remark.text
        and "was scaled by 1000" in remark.text
    )
    np.testing.assert_allclose(patient.from_file @ [0.0, 1.0, 0.1, 1.0], [0, -100, 1000, 1])


@pytest.mark.parametrize("ending", FORMATS)
def test_what_is_written_is_read_the_same(tmp_path, ending):
    mesh = trimesh.creation.icosphere(3, radius=30.0)
    mesh.apply_translation([10.0, 20.0, 90.0])
    path = tmp_path / f"ball.{ending}"
    path.write_bytes(mesh_bytes(mesh, ending))
    np.testing.assert_allclose(read_mesh(path).bounds, mesh.bounds, atol=1e-3)
    assert read_mesh(path).volume == pytest.approx(mesh.volume, rel=1e-5)
    if ending == "glb":
        bounds = trimesh.load_scene(path).bounds
        np.testing.assert_allclose(bounds, [[-0.02, 0.06, -0.05], [0.04, 0.12, 0.01]], atol=1e-6)


@pytest.mark.parametrize("ending", ["ply", "glb", "vtk"])
def test_a_stretch_that_was_not_copied_is_refused(tmp_path, ending):
    path = tmp_path / f"ball.{ending}"
    mesh = trimesh.creation.icosphere(3, radius=30.0)
    path.write_bytes(
        legacy_vtk(mesh.vertices, {"POLYGONS": mesh.faces.tolist()}, True)
        if ending == "vtk"
        else mesh_bytes(mesh, ending)
    )
    content = path.read_bytes()
    for at in (len(content) // 3, 2 * len(content) // 3):
        path.write_bytes(content[:at] + bytes(600) + content[at + 600 :])
        with pytest.raises(InputError, match=r"was not copied whole|missing vertices|do not add up"):
            read_patient(path)


def test_coordinates_of_no_size_and_missing_vertices_are_refused(tmp_path):
    far = np.array(POINTS) / 1000
    far[5] = 1e20
    (tmp_path / "scan.glb").write_bytes(glb(far, FACES))
    with pytest.raises(InputError, match=r"has a coordinate of 1e\+20, so it is damaged"):
        read_patient(tmp_path / "scan.glb")
    (tmp_path / "scan.glb").write_bytes(glb(POINTS / 1000, np.array(FACES) + 1))
    with pytest.raises(InputError, match="name missing vertices"):
        read_patient(tmp_path / "scan.glb")


@pytest.mark.parametrize("ending", ["vtp", "glb", "ply", "stl"])
def test_bytes_after_the_end_do_no_harm(tmp_path, ending):
    path = tmp_path / f"block.{ending}"
    path.write_bytes(mesh_bytes(BLOCK, ending) + b"signature 0123")
    patient = read_patient(path)
    assert patient.mesh_mm.volume == pytest.approx(240_000, rel=1e-6)
    assert "trailing" in [remark.topic for remark in patient.remarks]
