"""Patients from every kind of file, and what is found wrong with them."""

from __future__ import annotations

from dataclasses import replace

import nibabel
import nrrd
import numpy as np
import pytest
import pyvista
import trimesh

from naisr_model.data.meshes import hole_areas_mm2
from naisr_model.data.patients import (
    MOST_FACES,
    PatientShape,
    check_patient,
    decimated,
    flipped,
    moved,
    read_patient,
    read_points,
    repaired,
    scaled,
)
from naisr_model.errors import InputError
from naisr_model.exports import mesh_bytes
from naisr_model.frames import Frame

FRAME = Frame((0.0, 0.0, 0.0), 115.0)
"""A population whose largest shape is 200 mm long."""


def body() -> trimesh.Trimesh:
    """An ellipsoid of 120 mm in the middle of the frame."""
    mesh = trimesh.creation.icosphere(4, radius=60.0)
    mesh.apply_scale([1.0, 0.6, 0.4])
    mesh.apply_translation([3.0, -4.0, 5.0])
    return mesh


def cloud(points) -> trimesh.Trimesh:
    return trimesh.Trimesh(points, np.zeros((0, 3), int), process=False)


def topics(patient: PatientShape) -> list[str]:
    return [remark.topic for remark in check_patient(patient, FRAME)]


# --- reading ------------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", [".stl", ".ply", ".obj", ".vtk", ".vtp", ".glb"])
def test_a_sound_mesh_has_no_remarks(tmp_path, suffix):
    path = tmp_path / f"scan{suffix}"
    if suffix == ".glb":
        path.write_bytes(mesh_bytes(body(), "glb"))
    else:
        pyvista.wrap(body()).save(path)
    patient = read_patient(path)
    assert patient.is_closed and not patient.is_cloud
    assert patient.source == f"scan{suffix}, 5,120 faces"
    assert patient.mesh_mm.volume == pytest.approx(body().volume, rel=1e-4)
    assert check_patient(patient, FRAME) == ()


def test_points_are_read_from_meshes_without_faces(tmp_path):
    points = np.asarray(body().vertices)
    trimesh.PointCloud(points).export(tmp_path / "cloud.ply")
    pyvista.PolyData(points).save(tmp_path / "cloud.vtp")
    lines = "\n".join("v {:.6f} {:.6f} {:.6f}".format(*point) for point in points)
    (tmp_path / "cloud.obj").write_text(lines + "\n")
    for name in ("cloud.ply", "cloud.vtp", "cloud.obj"):
        patient = read_patient(tmp_path / name)
        assert patient.is_cloud and not patient.is_closed
        assert [(remark.severity, remark.topic) for remark in patient.remarks] == [("look", "cloud")]
        np.testing.assert_allclose(patient.mesh_mm.vertices, points, atol=1e-4)
        assert check_patient(patient, FRAME) == ()


TEXTS = {
    "plain.xyz": "1 2 3\n4 5 6\n",
    "tabs.txt": "# made by hand\n1\t2\t3\t0.5\n\n4\t5\t6\t0.5\n",
    "head.csv": "id,X,Y,Z\na,1,2,3\nb,4,5,6\n",
    "turned.csv": "z;x;y\n3;1;2\n6;4;5\n",
    "spaced.csv": "\ufeffx, y, z\n1, 2, 3\n4, 5, 6\n",
}


@pytest.mark.parametrize("name", TEXTS)
def test_text_gives_points(tmp_path, name):
    (tmp_path / name).write_text(TEXTS[name], encoding="utf-8")
    np.testing.assert_array_equal(read_points(tmp_path / name), [[1, 2, 3], [4, 5, 6]])


BAD_TEXTS = {
    "empty.xyz": ("# nothing\n", "is empty"),
    "words.txt": ("this is no cloud\nof points\n", "no columns x, y and z"),
    "names.csv": ("a,b,c\n1,2,3\n", "no columns x, y and z"),
    "short.xyz": ("1 2 3\n4 5\n", "a line without three numbers"),
    "letters.xyz": ("1 2 3\n4 5 six\n", "a line without three numbers"),
    "nan.xyz": ("1 2 3\n4 5 nan\n", "missing value"),
    "head.csv": ("x,y,z\n", "no points"),
    "infinite.xyz": ("1 2 3\n4 inf 6\n", "row 2 is a line without three numbers: 'inf'; expected a number"),
    "large.xyz": ("1 2 3\n4 5 1e308\n", "row 2 .*'1e308', larger than anything that is measured"),
    "twice.csv": ("x,y,z,x [mm]\n1,2,3,4\n", "has the column 'x' twice; rename one"),
}


@pytest.mark.filterwarnings("ignore:loadtxt")
@pytest.mark.parametrize("name", BAD_TEXTS)
def test_text_that_is_no_points_is_explained(tmp_path, name):
    content, match = BAD_TEXTS[name]
    (tmp_path / name).write_text(content)
    with pytest.raises(InputError, match=match) as error:
        read_patient(tmp_path / name)
    assert name in str(error.value)


def test_other_files_are_explained(tmp_path):
    (tmp_path / "picture.xyz").write_bytes(bytes(range(256)))
    with pytest.raises(InputError, match=r"picture\.xyz is no text"):
        read_patient(tmp_path / "picture.xyz")
    with pytest.raises(InputError, match=r"gone\.xyz does not exist"):
        read_patient(tmp_path / "gone.xyz")
    (tmp_path / "scan.dcm").write_bytes(b"no mesh")
    with pytest.raises(InputError, match=r"scan\.dcm is not one of .*\.nrrd.*\.xyz"):
        read_patient(tmp_path / "scan.dcm")
    body().export(tmp_path / "scan.ply")
    with pytest.raises(InputError, match="label 2 cannot be chosen"):
        read_patient(tmp_path / "scan.ply", label=2)
    pyvista.ImageData(dimensions=(4, 4, 4)).save(tmp_path / "grid.vtk")
    with pytest.raises(InputError, match=r"grid\.vtk holds a grid of voxels"):
        read_patient(tmp_path / "grid.vtk")


def labelled(tmp_path, name="scan.nii.gz"):
    """Two balls of 12 and 6 mm in voxels of half a millimetre, the small one cut by the image's edge."""
    index = np.stack(np.meshgrid(*[np.arange(80)] * 3, indexing="ij"), axis=-1) / 2
    voxels = np.where(np.linalg.norm(index - 20, axis=-1) < 12, 1, 0)
    voxels[np.linalg.norm(index - [37, 37, 37], axis=-1) < 6] = 4
    matrix = np.diag([0.5, 0.5, 0.5, 1.0])
    matrix[:3, 3] = (100, -50, 20)
    if name.endswith("nrrd"):
        space = {"space": "LPS", "space directions": matrix[:3, :3], "space origin": matrix[:3, 3]}
        nrrd.write(str(tmp_path / name), voxels.astype(np.uint8), space)
    else:
        image = nibabel.Nifti1Image(voxels.astype(np.uint8), np.diag([-1, -1, 1, 1]) @ matrix)
        image.to_filename(tmp_path / name)
    return tmp_path / name


@pytest.mark.parametrize("name", ["scan.nii.gz", "scan.nii", "scan.nrrd"])
def test_a_label_is_chosen(tmp_path, name):
    path = labelled(tmp_path, name)
    with pytest.raises(InputError, match=r"2 labels \(1: 7\.\d+ cm³, 4: 0\.\d+ cm³\); choose one"):
        read_patient(path)
    with pytest.raises(InputError, match="no label 9; it has 1: "):
        read_patient(path, label=9)
    patient = read_patient(path, label=1)
    assert (patient.source, patient.space, patient.remarks) == (f"{name}, label 1", "LPS", ())
    assert patient.is_closed
    assert patient.mesh_mm.volume == pytest.approx(4 / 3 * np.pi * 12**3, rel=0.005)
    np.testing.assert_allclose(patient.mesh_mm.center_mass, [120, -30, 40], atol=0.02)
    (remark,) = read_patient(path, label=4).remarks
    assert remark.severity == "look" and "edge of the image" in remark.text


def test_a_volume_without_labels_is_rejected(tmp_path):
    space = {"space": "LPS", "space directions": np.eye(3), "space origin": np.zeros(3)}
    nrrd.write(str(tmp_path / "none.nrrd"), np.zeros((9, 9, 9), np.uint8), space)
    with pytest.raises(InputError, match=r"none\.nrrd has no label; every voxel is 0"):
        read_patient(tmp_path / "none.nrrd")


# --- checks -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("unit", "mm"), [("metres", 1000.0), ("centimetres", 10.0), ("inches", 25.4)])
def test_units_are_guessed_and_set_right(unit, mm):
    size = 0.55 if unit == "inches" else 1.0  # at full size inches could as well be small centimetres
    patient = scaled(PatientShape(body()), size / mm)
    (remark,) = check_patient(patient, FRAME)
    assert (remark.severity, remark.topic) == ("refuse", "units")
    assert f"look like {unit}" in remark.sentence
    right = repaired(patient, FRAME)
    np.testing.assert_allclose(right.mesh_mm.bounds, size * body().bounds, rtol=1e-9)
    (told,) = right.remarks
    assert (told.severity, told.topic) == ("fine", "units") and told.text.endswith(f"it was scaled by {mm:g}")
    assert check_patient(right, FRAME) == ()


def test_a_unit_that_the_file_states_is_not_overruled():
    patient = replace(scaled(PatientShape(body()), 0.001), is_unit_stated=True)
    (remark,) = check_patient(patient, FRAME)
    assert (remark.severity, remark.topic) == ("refuse", "units")
    assert remark.sentence.startswith("by the unit that the file states, the shape is 0.12 mm long")
    assert remark.sentence.endswith("so its numbers look like metres")
    assert remark.remedy.endswith("--scale 1000 for metres")
    assert repaired(patient, FRAME) is patient
    assert check_patient(replace(PatientShape(body()), is_unit_stated=True), FRAME) == ()


def test_coordinates_of_no_body_are_refused():
    (remark,) = check_patient(scaled(PatientShape(body()), 1e15), FRAME)
    assert (remark.severity, remark.topic) == ("refuse", "numbers")
    assert "coordinates up to" in remark.sentence and "--scale" in remark.remedy


def test_two_units_that_explain_a_size_are_not_guessed_between():
    """71 might be inches, a person, or centimetres, a small child."""
    people = Frame((0.0, 0.0, 0.0), 1150.0)
    patient = scaled(PatientShape(body()), 71 / 120)
    (remark,) = check_patient(patient, people)
    assert (remark.severity, remark.topic) == ("refuse", "units")
    assert "look like centimetres or inches" in remark.text
    assert "--scale 10 for centimetres or --scale 25.4 for inches" in remark.remedy
    assert repaired(patient, people) is patient


def test_a_glb_in_millimetres_is_told_from_one_in_metres(tmp_path):
    (tmp_path / "scan.glb").write_bytes(mesh_bytes(body(), "glb"))
    metres = read_patient(tmp_path / "scan.glb")
    assert metres.unit_mm == 1000 and check_patient(metres, FRAME) == ()
    body().export(tmp_path / "scan.glb")  # against the convention
    patient = repaired(read_patient(tmp_path / "scan.glb"), FRAME)
    assert patient.mesh_mm.volume == pytest.approx(body().volume, rel=1e-5)
    assert "look like millimetres" in patient.remarks[-1].text


def test_debris_does_not_hide_the_unit_or_the_place():
    crumb = trimesh.creation.icosphere(2, radius=1.0)
    crumb.apply_translation([900.0, 0.0, 0.0])
    patient = PatientShape(body() + crumb)
    assert sorted(topics(patient)) == ["components", "debris"]
    points = np.vstack([body().vertices, [[900.0, 0.0, 0.0]]])
    assert topics(PatientShape(cloud(points))) == ["debris"]


def test_a_size_that_no_unit_explains_is_left_to_a_person():
    (remark,) = check_patient(scaled(PatientShape(body()), 7.0), FRAME)
    assert (remark.severity, remark.topic) == ("refuse", "units")
    assert "840 mm long" in remark.sentence and "200 mm" in remark.sentence


def test_voxel_indices_are_suspected():
    grid = np.zeros((60, 60, 60), np.float32)
    grid[10:50, 15:45, 20:40] = 1
    surface = pyvista.wrap(grid).contour([0.5], method="flying_edges")
    (remark,) = check_patient(PatientShape(trimesh.Trimesh(surface.points, surface.regular_faces)), FRAME)
    assert remark.topic == "voxels"
    assert "voxel size" in remark.remedy


def test_unusable_shapes_are_errors():
    broken = body()
    broken.vertices[3] = np.nan
    flat = np.random.default_rng(0).uniform(-50, 50, (200, 3)) * [1, 1, 0]
    sheet = trimesh.creation.icosphere(3, radius=50.0)
    sheet.update_faces(sheet.triangles_center[:, 2] > 0)
    doubled = trimesh.Trimesh(sheet.vertices, np.vstack([sheet.faces, sheet.faces[:, ::-1]]), process=False)
    cases = {"empty": cloud(np.zeros((0, 3))), "numbers": broken, "flat": cloud(flat)}
    for topic, mesh in {**cases, "few": cloud(body().vertices[:9])}.items():
        (remark,) = check_patient(PatientShape(mesh), FRAME)
        assert (remark.severity, remark.topic) == ("refuse", "empty" if topic == "few" else topic)
    assert topics(PatientShape(doubled)) == ["flat"]


def test_a_shape_far_away_must_be_aligned():
    away = body()
    away.apply_translation([0, 0, 900.0])
    (remark,) = check_patient(PatientShape(away), FRAME)
    assert (remark.severity, remark.topic) == ("refuse", "far")
    assert "905 mm" in remark.sentence and "icp" in remark.remedy
    away.apply_translation([0, 0, -795.0])
    (remark,) = check_patient(PatientShape(away), FRAME)
    assert (remark.severity, remark.topic) == ("look", "outside")


def test_faces_that_look_inward_are_turned():
    inside_out = body()
    inside_out.invert()
    patient = repaired(PatientShape(inside_out), FRAME)
    (remark,) = patient.remarks
    assert remark.topic == "inverted" and "100 % of the faces looked inward" in remark.sentence
    assert check_patient(patient, FRAME) == ()
    assert patient.mesh_mm.volume == pytest.approx(body().volume)


def test_an_open_surface_that_looks_inward_is_turned():
    part = body()
    part.update_faces(part.triangles_center[:, 0] < 20.0)
    part.remove_unreferenced_vertices()
    outward = PatientShape(trimesh.Trimesh(part.vertices, part.faces, process=False))
    assert topics(outward) == ["open"]
    part.invert()
    assert topics(PatientShape(part)) == ["inverted", "open"]
    np.testing.assert_array_equal(
        flipped(PatientShape(part)).mesh_mm.face_normals, outward.mesh_mm.face_normals
    )


def test_components_are_counted_and_the_largest_kept():
    crumb = trimesh.creation.icosphere(2, radius=3.0)
    crumb.apply_translation([70.0, 0.0, 0.0])
    patient = PatientShape(body() + crumb)
    (remark,) = check_patient(patient, FRAME)
    share = body().area / (body().area + crumb.area)
    assert (remark.severity, remark.topic) == ("look", "components")
    assert "2 components" in remark.sentence and f"{100 * share:.1f} %" in remark.sentence
    assert repaired(patient, FRAME) is patient
    kept = PatientShape(max(patient.mesh_mm.split(), key=lambda part: float(part.area)))
    assert kept.mesh_mm.volume == pytest.approx(body().volume)
    assert check_patient(kept, FRAME) == ()


def test_holes_are_measured():
    tube = trimesh.creation.cylinder(radius=10.0, height=100.0, sections=64)
    side = np.abs(tube.face_normals[:, 2]) < 0.5
    tube.update_faces(side)
    tube.remove_unreferenced_vertices()
    cap_mm2 = 32 * 10.0**2 * np.sin(2 * np.pi / 64)
    np.testing.assert_allclose(hole_areas_mm2(tube), [cap_mm2, cap_mm2], rtol=1e-6)
    tube = tube.subdivide_to_size(20.0)
    (remark,) = check_patient(PatientShape(tube), FRAME)
    assert (remark.severity, remark.topic) == ("look", "open")
    assert f"2 holes of {200 * cap_mm2 / (2 * cap_mm2 + tube.area):.1f} %" in remark.sentence
    assert not len(hole_areas_mm2(body()))


def test_stated_ras_is_told(tmp_path):
    body().export(tmp_path / "scan.stl")
    content = bytearray((tmp_path / "scan.stl").read_bytes())
    content[:29] = b"3D Slicer output. SPACE=RAS  "
    (tmp_path / "scan.stl").write_bytes(content)
    patient = read_patient(tmp_path / "scan.stl")
    (remark,) = check_patient(patient, FRAME)
    assert (remark.severity, remark.topic) == ("look", "space")
    turned = replace(moved(patient, np.diag([-1.0, -1.0, 1.0, 1.0])), space="LPS")
    np.testing.assert_allclose(turned.mesh_mm.center_mass, [-3, 4, 5], atol=1e-3)
    assert check_patient(turned, FRAME) == ()


def test_a_very_fine_surface_is_decimated():
    fine = trimesh.creation.torus(50.0, 20.0, major_sections=900, minor_sections=300)
    assert len(fine.faces) > MOST_FACES
    patient = repaired(PatientShape(fine), FRAME)
    (remark,) = patient.remarks
    assert remark.topic == "fine" and "was thinned" in remark.text and check_patient(patient, FRAME) == ()
    assert len(patient.mesh_mm.faces) < MOST_FACES
    assert patient.is_closed
    assert patient.mesh_mm.volume == pytest.approx(fine.volume, rel=1e-3)
    coarse = np.asarray(decimated(PatientShape(fine), 20_000).mesh_mm.vertices)
    ring = np.linalg.norm(coarse[:, :2], axis=1) - 50
    np.testing.assert_allclose(np.hypot(ring, coarse[:, 2]), 20.0, atol=0.1)
