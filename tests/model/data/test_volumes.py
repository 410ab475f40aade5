"""Label volumes against an analytic ellipsoid; the files are written byte by byte from the formats' rules."""

from __future__ import annotations

import gzip
import struct

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from naisr_model.data.meshes import rim
from naisr_model.data.patients import read_patient
from naisr_model.data.volumes import (
    LabelVolume,
    choose,
    is_label_volume,
    label_remarks,
    label_surface,
    read_labels,
    titles,
    touches_edge,
    volumes_cm3,
)
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


def metaimage(voxels, matrix) -> bytes:
    steps = np.linalg.norm(matrix[:3, :3], axis=0)
    kinds = {"uint8": "MET_UCHAR", "int16": "MET_SHORT", "float32": "MET_FLOAT"}
    lines = (
        "ObjectType = Image",
        "NDims = 3",
        "BinaryData = True",
        "TransformMatrix = " + " ".join(map(str, (matrix[:3, :3] / steps).T.ravel())),
        "Offset = " + " ".join(map(str, matrix[:3, 3])),
        "ElementSpacing = " + " ".join(map(str, steps)),
        "DimSize = " + " ".join(map(str, voxels.shape)),
        f"ElementType = {kinds[voxels.dtype.name]}",
        "ElementDataFile = LOCAL\n",
    )
    return "\n".join(lines).encode() + voxels.tobytes(order="F")


def write(path, content: bytes):
    path.write_bytes(gzip.compress(content, 1) if path.suffix == ".gz" else content)
    return path


KINDS = {
    "a.nii": lambda voxels, matrix: nifti(voxels, RAS @ matrix),
    "a.nii.gz": lambda voxels, matrix: nifti(voxels, RAS @ matrix),
    "metres.nii": lambda voxels, matrix: nifti(voxels, np.diag([1e-3] * 3 + [1]) @ RAS @ matrix, unit=1),
    "lps.nrrd": nrrd,
    "lps.mha": metaimage,
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
    axis = np.array([1.0, 0.5, 0.3]) / np.linalg.norm([1.0, 0.5, 0.3])
    points = np.stack(np.meshgrid(*[np.arange(40.0)] * 3, indexing="ij"), axis=-1) - [19.8, 19.7, 19.9]
    along = np.clip(points @ axis, -14, 14)
    inside = np.linalg.norm(points - along[..., None] * axis, axis=-1) < 2.5
    volume = LabelVolume(inside.astype(np.uint8), np.eye(4), {}, ())
    true_mm3 = np.pi * 2.5**2 * 28 + 4 / 3 * np.pi * 2.5**3
    assert label_surface(volume, 1).volume == pytest.approx(true_mm3, rel=0.03)
    assert label_remarks(volume, 1, label_surface(volume, 1)) == ()


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


@pytest.mark.parametrize("value", [2.00007, 6.9999, 6.9999999, 2.0, 3e9, -3.0])
@pytest.mark.parametrize("name", ["float.nii", "float.nrrd"])
def test_whole_numbers_stored_as_fractions_are_labels(tmp_path, name, value):
    voxels = np.zeros((9, 9, 9), np.float32)
    voxels[3:6, 3:6, 3:6] = value
    write_as = nifti if name == "float.nii" else nrrd
    volume = read_labels(write(tmp_path / name, write_as(voxels, np.eye(4))))
    assert np.issubdtype(volume.labels.dtype, np.integer)
    assert volumes_cm3(volume) == {round(value): pytest.approx(0.027)}


@pytest.mark.parametrize(("slope", "intercept"), [(1.0, 0.0), (0.1, 0.0), (2.0, 5.0), (-1.0, 0.0)])
def test_scaled_integers_are_labels(tmp_path, slope, intercept):
    voxels = np.full((9, 9, 9), round(-intercept / slope), np.int16)
    voxels[3:6, 3:6, 3:6] = round((7 - intercept) / slope)
    content = bytearray(nifti(voxels, np.eye(4)))
    struct.pack_into("<2f", content, 112, slope, intercept)
    volume = read_labels(write(tmp_path / "a.nii", bytes(content)))
    sizes = volumes_cm3(volume)
    assert sizes[7] == pytest.approx(0.027)
    assert set(sizes) <= {-1, 1, 7}  # a step of 2 does not reach 0


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
    "empty.nii": (b"", r"is empty \(0 bytes\); copy or export it again"),
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


# --- choosing -----------------------------------------------------------------------------------


def cubes(**labels: int) -> np.ndarray:
    """Cubes of ten voxels' length beside each other, of the labels in their order."""
    voxels = np.zeros((12 * len(labels), 12, 12), np.int16)
    for place, label in enumerate(labels.values()):
        voxels[12 * place + 1 : 12 * place + 11, 1:11, 1:11] = label
    return voxels


def segments(*named: tuple[str, int, int]) -> str:
    """Header lines of 3D Slicer: name, label value and layer of each segment."""
    return "".join(
        f"Segment{n}_Name:={name}\nSegment{n}_LabelValue:={value}\nSegment{n}_Layer:={layer}\n"
        for n, (name, value, layer) in enumerate(named)
    )


def chosen(path, label) -> int:
    return choose(path.name, read_labels(path), label)[1]


def test_a_number_comes_before_a_name_and_a_name_before_its_other_spellings(tmp_path):
    names = segments(
        ("1", 2, 0), ("airway", 1, 0), ("Airway", 3, 0), ("AIRWAY", 4, 0), ("tongue", 5, 0), ("9", 6, 0)
    )
    content = nrrd(cubes(a=1, b=2, c=3, d=4, e=5, f=6), np.eye(4), extra=names)
    path = write(tmp_path / "a.nrrd", content)
    assert [chosen(path, label) for label in ("1", 1, " 2 ", "+3")] == [1, 1, 2, 3]
    assert chosen(path, "9") == 6  # there is no label 9
    assert [chosen(path, label) for label in ("airway", "Airway", "AIRWAY")] == [1, 3, 4]
    assert chosen(path, "TONGUE") == 5
    with pytest.raises(InputError, match=r"3 labels that 'aIRWAY' may mean; choose one of '1', '3', '4'"):
        chosen(path, "aIRWAY")
    for unknown in ("7", "-1", "0", "nose", "1.5", ""):
        with pytest.raises(InputError, match=rf"no label {unknown}; it has 1 'airway': 1 cm³, 2 '1': 1 cm³"):
            chosen(path, unknown)


def test_a_label_that_is_named_is_read_among_any_others(tmp_path):
    voxels = np.arange(1, 1 + 15**3, dtype=np.int16).reshape(15, 15, 15) % 1500
    voxels[4:8, 4:8, 4:8] = 4512
    path = write(tmp_path / "many.nii", nifti(voxels, np.eye(4)))
    assert chosen(path, "4512") == 4512
    assert read_patient(path, "4512").mesh_mm.volume == pytest.approx(64, rel=0.02)
    with pytest.raises(InputError, match=r"many\.nii holds 1,500 values from 1 to 4512, so it is a scan"):
        chosen(path, None)
    with pytest.raises(InputError, match="so it is a scan"):
        titles(path.name, read_labels(path))
    with pytest.raises(InputError, match=r"no label 1777; it has 1: .* and 1,492 more"):
        chosen(path, 1777)


def test_negative_labels_are_chosen_and_never_taken_unasked(tmp_path):
    path = write(tmp_path / "a.nii", nifti(cubes(a=-3, b=2), np.eye(4)))
    assert chosen(path, "-3") == chosen(path, -3) == -3
    with pytest.raises(InputError, match=r"2 labels \(-3: 1 cm³, 2: 1 cm³\); choose one"):
        chosen(path, None)
    path = write(tmp_path / "b.nii", nifti(cubes(a=-1), np.eye(4)))
    with pytest.raises(InputError, match=r"a negative label alone \(-1: 1 cm³\); choose"):
        chosen(path, None)


def test_a_list_of_labels_is_short(tmp_path):
    voxels = np.arange(1, 1 + 6**3, dtype=np.int16).reshape(6, 6, 6)
    path = write(tmp_path / "a.nii", nifti(voxels, np.eye(4)))
    with pytest.raises(
        InputError, match=r"216 labels \(1: 0\.001 cm³, .* and 208 more\); choose one"
    ) as error:
        chosen(path, None)
    assert len(str(error.value)) < 250


def layered(tmp_path, *named: tuple[str, int, int]):
    """Two layers: cubes of 10 and of 6 voxels' length inside each other, one label 1, one 1, then 2 apart."""
    voxels = np.zeros((2, 14, 14, 30), np.uint8)
    voxels[0, 2:12, 2:12, 2:12] = 1
    voxels[1, 4:10, 4:10, 4:10] = 1
    voxels[1, 2:12, 2:12, 16:26] = 2
    header = nrrd(voxels[0], np.diag([2.0, 2, 2, 1]), extra=segments(*named)).split(b"\n\n")[0].decode()
    for old, new in (
        ("dimension: 3", "dimension: 4"),
        ("sizes: ", "sizes: 2 "),
        ("directions: ", "directions: none "),
        ("kinds: ", "kinds: list "),
    ):
        header = header.replace(old, new)
    return write(tmp_path / "two.seg.nrrd", f"{header}\n\n".encode() + voxels.tobytes(order="F"))


def test_overlapping_segments_are_chosen_by_name(tmp_path):
    path = layered(tmp_path, ("airway", 1, 0), ("tongue", 1, 1), ("nose", 2, 1))
    sizes = {label: read_patient(path, label).mesh_mm.volume for label in ("airway", "tongue", "Nose", 2)}
    assert sizes == pytest.approx({"airway": 8000, "tongue": 1728, "Nose": 8000, 2: 8000}, rel=0.02)
    assert read_patient(path, "tongue").source == "two.seg.nrrd, label 1 'tongue'"
    with pytest.raises(InputError, match=r"2 labels that '1' may mean; choose one of 'airway', 'tongue'"):
        read_patient(path, 1)
    with pytest.raises(
        InputError, match=r"3 labels \(1 'airway': 8 cm³, 1 'tongue': 1\.73 cm³, 2 'nose': 8 cm³\)"
    ):
        read_patient(path)


def test_layers_of_older_segmentations_are_named_in_their_order(tmp_path):
    path = layered(tmp_path, ("airway", 1, 0), ("tongue", 1, 1))
    content = path.read_bytes().replace(b"_LabelValue:=1", b"_Color:=1").replace(b"_Layer:=", b"_Tags:=")
    path.write_bytes(content)
    assert read_patient(path, "airway").mesh_mm.volume == pytest.approx(8000, rel=0.02)
    assert read_patient(path, "tongue").mesh_mm.volume == pytest.approx(1728, rel=0.02)


@pytest.mark.parametrize("names", [("airway", "tongue"), ("same", "same"), ("1", "2"), ("", "")])
def test_every_title_leads_to_its_own_label(tmp_path, names):
    path = layered(tmp_path, (names[0], 1, 0), (names[1], 1, 1))
    volume = read_labels(path)
    told = titles(path.name, volume)
    assert len(told) == 3
    found = {id(layer.labels): label for layer, label in (choose(path.name, volume, key) for key in told)}
    volumes = sorted(read_patient(path, key).mesh_mm.volume for key in told)
    assert volumes == pytest.approx([1728, 8000, 8000], rel=0.02)
    assert len(found) == 2


# --- surfaces -----------------------------------------------------------------------------------


def touching(*corners: tuple[int, int, int], side: int = 9) -> np.ndarray:
    """Cubes of voxels."""
    where = np.zeros((40, 40, 40), np.uint8)
    for i, j, k in corners:
        where[i : i + side, j : j + side, k : k + side] = 1
    return where


MEETING = {
    "one": touching((3, 3, 3)),
    "edge": touching((3, 3, 3), (12, 12, 3)),
    "corner": touching((3, 3, 3), (12, 12, 12)),
    "stairs": touching((3, 3, 3), (12, 12, 3), (21, 3, 3), (12, 3, 12), (21, 12, 12), side=9),
    "voxel": touching((3, 3, 3), side=1),
    "two voxels": touching((3, 3, 3), (4, 4, 3), side=1),
    "debris": touching((3, 3, 3), side=20) | touching((30, 30, 30), (33, 33, 33), side=1),
    "cavity": touching((3, 3, 3), side=20) - touching((9, 9, 9), (14, 14, 9), side=5),
    "noise": (np.random.default_rng(0).random((40, 40, 40)) < 0.4).astype(np.uint8),
    "checker": (np.indices((40, 40, 40)).sum(axis=0) % 2).astype(np.uint8),
}


@pytest.mark.parametrize("spacing", [(1.0, 1.0, 1.0), (0.8, 0.8, 2.5)])
@pytest.mark.parametrize("kind", MEETING)
def test_voxels_that_meet_anyhow_have_a_closed_surface_of_their_volume(kind, spacing):
    where = MEETING[kind]
    volume = LabelVolume(where, np.diag([*spacing, 1.0]), {}, ())
    surface = label_surface(volume, 1)
    assert surface.is_watertight and not len(rim(surface))
    assert surface.volume == pytest.approx(where.sum() * np.prod(spacing), rel=0.01)


@pytest.mark.parametrize("radius", [1.5, 2.0, 3.0])
def test_a_narrow_label_is_told(radius):
    index = np.indices((60, 20, 20)) - np.array([30.1, 9.7, 9.8])[:, None, None, None]
    where = (np.linalg.norm(index[1:], axis=0) < radius) & (np.abs(index[0]) < 25)
    volume = LabelVolume(where.astype(np.uint8), np.diag([0.5, 0.5, 0.5, 1.0]), {}, ())
    surface = label_surface(volume, 1)
    assert surface.volume == pytest.approx(where.sum() / 8, rel=0.01)
    assert [remark.topic for remark in label_remarks(volume, 1, surface)] == (["thin"] if radius < 2 else [])


# --- which reader -------------------------------------------------------------------------------


def test_a_label_volume_is_known_by_what_it_holds(tmp_path):
    content = nifti(cubes(a=1), np.eye(4))
    for name in ("scan.stl", "scan.csv", "scan"):
        path = write(tmp_path / name, content)
        assert is_label_volume(path)
        assert read_patient(path).mesh_mm.volume == pytest.approx(1000, rel=0.02)
    path = write(tmp_path / "points.csv", b"x,y,z\n0,0,0\n")
    assert not is_label_volume(path)
    assert is_label_volume(tmp_path / "gone.nii")
