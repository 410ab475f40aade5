"""Label volumes against an analytic ellipsoid; the files are written byte by byte from the formats' rules."""

from __future__ import annotations

import gzip
import struct

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from naisr_model.data.volumes import label_surface, read_labels, touches_edge, volumes_cm3
from naisr_model.errors import InputError

RAS = np.diag([-1.0, -1.0, 1.0, 1.0])
"""LPS to RAS and back."""

TURN = Rotation.from_euler("xyz", [20, -35, 50], degrees=True).as_matrix()
AXES_MM = np.array([25.0, 15.0, 10.0])
TILT = Rotation.from_euler("xyz", [50, 10, -20], degrees=True).as_matrix()
SIZE = (90, 60, 42)


def affine(steps=(0.7, 1.1, -1.5), origin=(10.0, -20.0, 300.0)) -> np.ndarray:
    """Oblique voxel axes in LPS, left-handed where an odd number of steps is negative."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = TURN @ np.diag(steps), origin
    return matrix


def to_ellipsoid(points_lps_mm, matrix) -> np.ndarray:
    """First-order signed distance in mm to an ellipsoid off the middle of the image, tilted in LPS."""
    centre = matrix[:3, :3] @ (np.array(SIZE) / 2 + [2.3, -1.1, 0.4]) + matrix[:3, 3]
    local = (np.asarray(points_lps_mm) - centre) @ TILT
    level = np.linalg.norm(local / AXES_MM, axis=-1)
    return (level - 1) * level / np.maximum(np.linalg.norm(local / AXES_MM**2, axis=-1), 1e-9)


def ellipsoid_voxels(matrix) -> np.ndarray:
    index = np.stack(np.meshgrid(*map(np.arange, SIZE), indexing="ij"), axis=-1)
    return (to_ellipsoid(index @ matrix[:3, :3].T + matrix[:3, 3], matrix) < 0).astype(np.uint8)


def nifti(voxels, matrix_ras, *, sform=1, unit=2, shape=None) -> bytes:
    """A NIfTI-1 file with an sform; unit 2 is millimetres and 1 metres."""
    codes = {"uint8": 2, "int16": 4, "float32": 16}
    shape = shape or voxels.shape
    header = bytearray(352)
    struct.pack_into("<i", header, 0, 348)
    struct.pack_into("<8h", header, 40, len(shape), *shape, *[1] * (7 - len(shape)))
    struct.pack_into("<2h", header, 70, codes[voxels.dtype.name], 8 * voxels.dtype.itemsize)
    spacing = np.linalg.norm(matrix_ras[:3, :3], axis=0)
    struct.pack_into("<8f", header, 76, 1, *spacing, *[1] * 4)
    struct.pack_into("<3f", header, 108, 352, 1, 0)
    header[123] = unit
    struct.pack_into("<2h", header, 252, 0, sform)
    struct.pack_into("<12f", header, 280, *matrix_ras[:3].ravel())
    header[344:348] = b"n+1\0"
    return bytes(header) + voxels.tobytes(order="F")


def nrrd(voxels, matrix, space="space: left-posterior-superior", extra="") -> bytes:
    names = {"uint8": "unsigned char", "int16": "short", "float32": "float"}
    vectors = ["(" + ",".join(map(repr, map(float, column))) + ")" for column in matrix[:3].T]
    lines = (
        "NRRD0004",
        f"type: {names[voxels.dtype.name]}",
        "dimension: 3",
        space,
        "sizes: " + " ".join(map(str, voxels.shape)),
        "space directions: " + " ".join(vectors[:3]),
        "kinds: domain domain domain",
        "endian: little",
        "encoding: raw",
        "space origin: " + vectors[3],
    )
    return ("\n".join(lines) + f"\n{extra}\n").encode() + voxels.tobytes(order="F")


def write(path, content: bytes):
    path.write_bytes(gzip.compress(content, 1) if path.suffix == ".gz" else content)
    return path


KINDS = {
    "a.nii": lambda voxels, matrix: nifti(voxels, RAS @ matrix),
    "a.nii.gz": lambda voxels, matrix: nifti(voxels, RAS @ matrix),
    "metres.nii": lambda voxels, matrix: nifti(voxels, np.diag([1e-3] * 3 + [1]) @ RAS @ matrix, unit=1),
    "lps.nrrd": nrrd,
    "ras.nrrd": lambda voxels, matrix: nrrd(voxels, RAS @ matrix, "space: right-anterior-superior"),
    "las.nrrd": lambda voxels, matrix: nrrd(voxels, np.diag([-1.0, 1, 1, 1]) @ RAS @ matrix, "space: LAS"),
}


@pytest.mark.parametrize("steps", [(0.7, 1.1, -1.5), (-0.7, -1.1, -1.5), (1.0, 1.0, 1.0)])
@pytest.mark.parametrize("name", KINDS)
def test_the_ellipsoid_is_where_it_is_in_lps(tmp_path, name, steps):
    matrix = affine(steps)
    volume = read_labels(write(tmp_path / name, KINDS[name](ellipsoid_voxels(matrix), matrix)))
    np.testing.assert_allclose(volume.to_lps_mm, matrix, atol=1e-4)
    np.testing.assert_allclose(volume.spacing_mm, np.abs(steps), atol=1e-5)
    assert volume.remarks == ()
    surface = label_surface(volume, 1)
    true_mm3 = 4 / 3 * np.pi * AXES_MM.prod()
    assert surface.is_watertight
    assert surface.volume == pytest.approx(true_mm3, rel=0.01)
    assert volumes_cm3(volume)[1] == pytest.approx(true_mm3 / 1000, rel=0.01)
    away_mm = to_ellipsoid(surface.vertices, matrix)
    assert np.sqrt((away_mm**2).mean()) < 0.25
    assert abs(away_mm.mean()) < 0.05


def test_a_thin_tube_keeps_its_volume():
    from naisr_model.data.volumes import LabelVolume

    axis = np.array([1.0, 0.5, 0.3]) / np.linalg.norm([1.0, 0.5, 0.3])
    points = np.stack(np.meshgrid(*[np.arange(40.0)] * 3, indexing="ij"), axis=-1) - [19.8, 19.7, 19.9]
    along = np.clip(points @ axis, -14, 14)
    inside = np.linalg.norm(points - along[..., None] * axis, axis=-1) < 2.5
    volume = LabelVolume(inside.astype(np.uint8), np.eye(4), {}, ())
    true_mm3 = np.pi * 2.5**2 * 28 + 4 / 3 * np.pi * 2.5**3
    assert label_surface(volume, 1).volume == pytest.approx(true_mm3, rel=0.03)


def test_labels_are_told_apart_and_named(tmp_path):
    voxels = np.zeros((20, 20, 20), np.uint8)
    voxels[2:8, 2:8, 2:8], voxels[12:16, 12:20, 12:16] = 3, 7
    names = "Segment0_LabelValue:=3\nSegment0_Name:=airway\n"
    volume = read_labels(write(tmp_path / "two.nrrd", nrrd(voxels, np.diag([2.0, 2, 2, 1]), extra=names)))
    assert volumes_cm3(volume) == {3: pytest.approx(6**3 * 8 / 1000), 7: pytest.approx(4 * 8 * 4 * 8 / 1000)}
    assert volume.names == {3: "airway"}
    assert not touches_edge(volume, 3)
    assert touches_edge(volume, 7)
    low, high = label_surface(volume, 3).bounds
    assert (low > 2).all() and (high < 17).all()
    assert not len(label_surface(volume, 5).faces)


def test_whole_numbers_stored_as_fractions_are_labels(tmp_path):
    voxels = np.zeros((9, 9, 9), np.float32)
    voxels[3:6, 3:6, 3:6] = 2
    volume = read_labels(write(tmp_path / "float.nii", nifti(voxels, np.eye(4))))
    assert np.issubdtype(volume.labels.dtype, np.integer)
    assert volumes_cm3(volume) == {2: pytest.approx(0.027)}


@pytest.mark.parametrize("name", ["plain.nii", "plain.nrrd"])
def test_an_unknown_orientation_is_said(tmp_path, name):
    voxels = np.zeros((9, 9, 9), np.uint8)
    voxels[3:6, 3:6, 3:6] = 1
    silent = (
        nifti(voxels, np.eye(4), sform=0)
        if name == "plain.nii"
        else nrrd(voxels, np.eye(4), "space dimension: 3")
    )
    (remark,) = read_labels(write(tmp_path / name, silent)).remarks
    assert "how the patient lies" in remark.sentence


def noise(dtype, low=-1000, high=3000) -> np.ndarray:
    return np.random.default_rng(0).uniform(low, high, (16, 15, 14)).astype(dtype)


SHEAR = np.array([[1, 0.2, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], float)
ONES = np.ones((16, 15, 14), np.uint8)

UNUSABLE = {
    "fraction.nii": (nifti(noise("float32"), np.eye(4)), "threshold or segment it"),
    "fraction.nrrd": (nrrd(noise("float32", 0, 1), np.eye(4)), "threshold or segment it"),
    "nan.nrrd": (nrrd(np.full((5, 5, 5), np.nan, np.float32), np.eye(4)), "not finite numbers"),
    "flat.nii": (nifti(ONES[:, :, 0], np.eye(4)), r"two-dimensional image \(16 x 15\)"),
    "one.nii": (nifti(ONES[:, :, :1], np.eye(4)), "two-dimensional image"),
    "time.nii": (nifti(np.stack([ONES] * 3, -1), np.eye(4)), "3 values a voxel; save one label volume"),
    "shear.nii": (nifti(ONES, SHEAR), "not at right angles; resample"),
    "shear.nrrd": (nrrd(ONES, SHEAR), "not at right angles; resample"),
    "words.nii": (b"this is no image\n" * 40, "damaged, export it again"),
    "words.nii.gz": (b"this is no image\n" * 40, "damaged, export it again"),
    "words.nrrd": (b"this is no image\n" * 40, "damaged, export it again"),
    "empty.nii": (b"", "is empty; copy or export it again"),
}


@pytest.mark.parametrize("name", UNUSABLE)
def test_what_is_no_label_volume_is_explained(tmp_path, name, capfd):
    content, match = UNUSABLE[name]
    with pytest.raises(InputError, match=match) as error:
        read_labels(write(tmp_path / name, content))
    assert name in str(error.value)
    assert capfd.readouterr().err == ""


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match=r"gone\.nii does not exist"):
        read_labels(tmp_path / "gone.nii")


@pytest.mark.parametrize("name", ["cut.nii", "cut.nii.gz", "cut.nrrd"])
def test_a_volume_that_was_cut_off_is_rejected(tmp_path, name):
    voxels = (noise("int16") > 900).astype(np.uint8)
    whole = write(
        tmp_path / name, nrrd(voxels, np.eye(4)) if name == "cut.nrrd" else nifti(voxels, np.eye(4))
    )
    content = whole.read_bytes()
    for share in (0.1, 0.3, 0.5, 0.8, 0.95, 0.999):
        whole.write_bytes(content[: int(share * len(content))])
        with pytest.raises(InputError, match=name):
            read_labels(whole)
