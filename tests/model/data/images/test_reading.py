"""Images as people's tools write them, by nibabel, pynrrd and by hand; the truth is what was put in."""

from __future__ import annotations

import bz2
import gzip
import struct
import zlib

import nibabel
import nrrd
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from naisr_model.data.images.reading import is_image, read_image
from naisr_model.errors import InputError

RAS = np.diag([-1.0, -1.0, 1.0, 1.0])
TURN = Rotation.from_euler("xyz", [20, -35, 50], degrees=True).as_matrix()
STEPS = (1.5, 1.5, 2.5)
SIZE = (20, 24, 16)


def block() -> np.ndarray:
    voxels = np.zeros(SIZE, np.uint8)
    voxels[3:9, 5:15, 2:12] = 2
    voxels[4, 6, 3] = 1  # tells the corners apart
    return voxels


def affine(turn=TURN, steps=STEPS, origin=(10.0, -20.0, 300.0)) -> np.ndarray:
    """Voxels to RAS."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn @ np.diag(steps), origin
    return matrix


def header_of(matrix=None, sform=1, qform=1, kind=nibabel.Nifti1Image, voxels=None) -> nibabel.Nifti1Image:
    image = kind(block() if voxels is None else voxels, affine() if matrix is None else matrix)
    matrix = image.affine.copy()
    image.set_sform(matrix, sform)
    image.set_qform(matrix, qform)
    image.header.set_xyzt_units("mm")
    return image


def nifti(image: nibabel.Nifti1Image, path, **fields):
    """Written as bytes, so that nothing is repaired on the way; fields of the header by name."""
    content = bytearray(image.to_bytes())
    size = 348 if isinstance(image, nibabel.Nifti1Image) and content[344:347] == b"n+1" else 540
    kind = nibabel.Nifti1Header if size == 348 else nibabel.Nifti2Header
    header = kind(bytes(content[:size]), check=False)
    for field, value in fields.items():
        header[field] = value
    content[:size] = header.binaryblock
    path.write_bytes(bytes(content))
    return path


def nrrd_file(path, voxels=None, encoding="raw", data=None, lines=(), without=(), **changed):
    """Bytes by hand: fields by name, ``_`` for a blank."""
    voxels = block() if voxels is None else voxels
    matrix = RAS @ affine()
    vectors = ["(" + ",".join(repr(float(x)) for x in column) + ")" for column in matrix[:3].T]
    fields = {
        "type": {"uint8": "uchar", "int16": "short", "float32": "float", "float64": "double"}[
            voxels.dtype.name
        ],
        "dimension": "3",
        "space": "left-posterior-superior",
        "sizes": " ".join(map(str, voxels.shape)),
        "space directions": " ".join(vectors[:3]),
        "space origin": vectors[3],
        "endian": "little",
        "encoding": encoding,
    } | {name.replace("_", " "): value for name, value in changed.items()}
    header = [f"{name}: {value}" for name, value in fields.items() if name not in without]
    content = voxels.tobytes(order="F") if data is None else data
    path.write_bytes("\n".join(["NRRD0004", *header, *lines, "", ""]).encode() + content)
    return path


def require_block(image, matrix_ras=None) -> None:
    np.testing.assert_array_equal(image.voxels[0], block())
    np.testing.assert_allclose(
        image.to_lps_mm, RAS @ (affine() if matrix_ras is None else matrix_ras), atol=2e-4
    )


# --- by content and not by name -----------------------------------------------------------------


@pytest.mark.parametrize("kind", [nibabel.Nifti1Image, nibabel.Nifti2Image])
@pytest.mark.parametrize("name", ["a.nii", "a.nii.gz", "a.nrrd", "a.stl", "a"])
@pytest.mark.parametrize("packed", [False, True])
def test_a_nifti_file_is_known_by_what_it_holds(tmp_path, kind, name, packed):
    content = header_of(kind=kind).to_bytes()
    (tmp_path / name).write_bytes(gzip.compress(content) if packed else content)
    assert is_image(tmp_path / name)
    image = read_image(tmp_path / name)
    require_block(image)
    assert image.remarks == ()


@pytest.mark.parametrize("name", ["a.nrrd", "a.nii", "a.nii.gz", "a.ply"])
@pytest.mark.parametrize("packed", [False, True])
def test_so_is_nrrd(tmp_path, name, packed):
    path = nrrd_file(tmp_path / name)
    if packed:
        path.write_bytes(gzip.compress(path.read_bytes()))
    assert is_image(path)
    require_block(read_image(path))


@pytest.mark.parametrize("order", ["<", ">"])
def test_both_byte_orders_are_read(tmp_path, order):
    voxels = block().astype(f"{order}i2")
    image = header_of(voxels=voxels)
    swapped = nibabel.Nifti1Image(voxels, image.affine, image.header.as_byteswapped(order))
    (tmp_path / "a.nii").write_bytes(swapped.to_bytes())
    require_block(read_image(tmp_path / "a.nii"))


@pytest.mark.parametrize("after", [b"some words", b"\0" * 700, b"\n"])
def test_what_follows_a_gzip_stream_is_left_out(tmp_path, after):
    (tmp_path / "a.nii.gz").write_bytes(gzip.compress(header_of().to_bytes()) + after)
    require_block(read_image(tmp_path / "a.nii.gz"))
    path = nrrd_file(tmp_path / "a.nrrd", encoding="gzip", data=gzip.compress(block().tobytes("F")) + after)
    require_block(read_image(path))


def test_more_than_is_announced_is_told(tmp_path):
    path = tmp_path / "a.nii"
    path.write_bytes(header_of().to_bytes() + b"surplus")
    packed = nrrd_file(
        tmp_path / "b.nrrd", encoding="gzip", data=gzip.compress(block().tobytes("F") + b"surplus")
    )
    for each in (path, nrrd_file(tmp_path / "a.nrrd", data=block().tobytes("F") + b"surplus"), packed):
        image = read_image(each)
        require_block(image)
        assert [remark.topic for remark in image.remarks] == ["surplus"]


def test_gzip_in_pieces_is_one_file(tmp_path):
    content = header_of().to_bytes()
    (tmp_path / "a.nii.gz").write_bytes(gzip.compress(content[:1000]) + gzip.compress(content[1000:]))
    require_block(read_image(tmp_path / "a.nii.gz"))


@pytest.mark.parametrize("encoding", ["raw", "gzip", "GZ", "bzip2", "ascii"])
def test_every_encoding_of_nrrd_is_read(tmp_path, encoding):
    raw = block().tobytes("F")
    packed = {
        "raw": raw,
        "bzip2": bz2.compress(raw),
        "ascii": " ".join(map(str, raw)).encode(),
    }.get(encoding, gzip.compress(raw))
    require_block(read_image(nrrd_file(tmp_path / "a.nrrd", encoding=encoding, data=packed)))


def test_voxels_beside_the_header_are_found(tmp_path):
    (tmp_path / "a.raw").write_bytes(b"two\nlines\n" + b"skip" + block().tobytes("F"))
    path = nrrd_file(tmp_path / "a.nhdr", data=b"", data_file="a.raw", line_skip="2", byte_skip="4")
    require_block(read_image(path))
    path = nrrd_file(tmp_path / "a.nhdr", data=b"", data_file="a.raw", byte_skip="-1")
    require_block(read_image(path))
    (tmp_path / "a.raw").unlink()
    with pytest.raises(InputError, match=r"a\.nhdr has its voxels in a\.raw, which is not there; keep both"):
        read_image(path)
    with pytest.raises(InputError, match="in several files"):
        read_image(nrrd_file(tmp_path / "a.nhdr", data=b"", data_file="a%02d.raw 1 9 1"))


def test_what_pynrrd_writes_is_read(tmp_path):
    matrix = RAS @ affine()
    header = {"space": "LPS", "space directions": matrix[:3, :3].T, "space origin": matrix[:3, 3]}
    nrrd.write(str(tmp_path / "a.nrrd"), block(), header)
    require_block(read_image(tmp_path / "a.nrrd"))
    nrrd.write(str(tmp_path / "a.nhdr"), block(), header, detached_header=True)
    require_block(read_image(tmp_path / "a.nhdr"))


def test_a_header_with_blanks_capitals_and_other_fields_is_read(tmp_path):
    matrix = RAS @ affine()
    vectors = ["( " + " , ".join(repr(float(x)) for x in column) + " )" for column in matrix[:3].T]
    path = nrrd_file(tmp_path / "a.nrrd", space_directions="".join(vectors[:3]), space_origin=vectors[3])
    content = path.read_bytes().replace(b"space directions:", b"Space Directions:", 1)
    odd = b"measurement frame: what?\n# a comment\nsizes:=none of a field\nname:=Luftr\xc3\xb6hre: oben\n"
    path.write_bytes(content.replace(b"encoding", odd + b"encoding", 1))
    image = read_image(path)
    require_block(image)
    assert image.metadata["name"] == "Luftröhre: oben"


# --- axes ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("decimals", [3, 4, 6])
def test_rounded_axes_are_straightened(tmp_path, decimals):
    turn = Rotation.from_euler("z", 20, degrees=True).as_matrix().round(decimals)
    nifti_path = nifti(header_of(affine(turn), qform=0), tmp_path / "a.nii")
    vectors = ["(" + ",".join(map(repr, column.tolist())) + ")" for column in (RAS @ affine(turn))[:3, :3].T]
    for path in (nifti_path, nrrd_file(tmp_path / "a.nrrd", space_directions=" ".join(vectors))):
        matrix = read_image(path).to_lps_mm[:3, :3]
        gram = matrix.T @ matrix
        np.testing.assert_allclose(gram, np.diag(np.diag(gram)), atol=1e-6)
        np.testing.assert_allclose(matrix, (RAS @ affine(turn))[:3, :3], atol=3e-3)


@pytest.mark.parametrize(("degrees", "is_read"), [(0.05, True), (0.2, True), (2.0, False), (12.0, False)])
def test_axes_are_refused_where_straightening_moves_a_voxel(tmp_path, degrees, is_read):
    shear = np.eye(4)
    shear[0, 1] = np.tan(np.radians(degrees))
    path = nifti(header_of(shear, qform=0), tmp_path / "a.nii")
    vectors = " ".join("(" + ",".join(map(repr, column.tolist())) + ")" for column in (RAS @ shear)[:3, :3].T)
    for each in (path, nrrd_file(tmp_path / "a.nrrd", space_directions=vectors)):
        if is_read:
            read_image(each)
        else:
            with pytest.raises(InputError, match="not at right angles; resample"):
                read_image(each)


SHIFTED = affine(origin=(40.0, -20.0, 300.0))
OTHERS = {
    "shift": SHIFTED,
    "scale": affine(steps=(1.0, 1.0, 1.0)),
    "mirror": affine() @ np.diag([-1.0, 1, 1, 1]),
    "turn": affine(np.eye(3)),
}


@pytest.mark.parametrize("kind", OTHERS)
def test_the_sform_is_used_and_a_qform_that_differs_is_told(tmp_path, kind):
    image = header_of()
    image.set_qform(OTHERS[kind], 1)
    path = nifti(image, tmp_path / "a.nii")
    read = read_image(path)
    require_block(read)
    np.testing.assert_allclose(
        RAS @ read.to_lps_mm, nibabel.Nifti1Image.from_filename(path).affine, atol=1e-5
    )
    assert "orientation" in {remark.topic for remark in read.remarks}
    assert any("differ" in remark.sentence for remark in read.remarks)
    if kind == "shift":
        assert "by up to 30 mm" in read.remarks[0].sentence


def test_the_qform_is_used_where_there_is_no_sform(tmp_path):
    image = header_of(sform=0)
    path = nifti(image, tmp_path / "a.nii", srow_x=[5, 0, 0, 0])
    read = read_image(path)
    require_block(read)
    assert read.remarks == ()
    require_block(read_image(nifti(image, path, pixdim=[0, *STEPS, 1, 1, 1, 1])))


def test_without_either_the_spacing_is_kept_and_the_orientation_unknown(tmp_path):
    read = read_image(nifti(header_of(sform=0, qform=0), tmp_path / "a.nii"))
    np.testing.assert_allclose(np.linalg.norm(read.to_lps_mm[:3, :3], axis=0), STEPS, rtol=1e-6)
    np.testing.assert_allclose(
        RAS @ read.to_lps_mm, nibabel.Nifti1Image.from_filename(tmp_path / "a.nii").affine, atol=1e-5
    )
    (remark,) = read.remarks
    assert (remark.severity, remark.topic) == ("look", "orientation")
    assert "how the patient lies" in remark.sentence


@pytest.mark.parametrize("told", [(1, 1, 1), (0, 0, 0), (np.nan, 1, 1), (-1.5, 1.5, 2.5)])
def test_spacing_comes_from_the_matrix_that_is_used(tmp_path, told):
    path = nifti(header_of(qform=0), tmp_path / "a.nii", pixdim=[1, *told, 1, 1, 1, 1])
    read = read_image(path)
    require_block(read)
    (remark,) = read.remarks
    assert remark.topic == "spacing" and "1.5 x 1.5 x 2.5 mm (sform)" in remark.sentence


@pytest.mark.parametrize("spacing", [(0, 1, 1), (np.nan, 1, 1), (np.inf, 1, 1), (-1, 1, 1)])
@pytest.mark.parametrize("qform", [0, 1])
def test_spacing_that_is_none_is_refused(tmp_path, spacing, qform):
    path = nifti(header_of(sform=0, qform=qform), tmp_path / "a.nii", pixdim=[1, *spacing, 1, 1, 1, 1])
    with pytest.raises(InputError, match=r"a\.nii has voxels of .* mm; set the spacing"):
        read_image(path)


@pytest.mark.parametrize("row", [[np.nan, 0, 0, 0], [0, np.inf, 0, 0], [0, 0, 0, np.nan], [0, 0, 0, 0]])
def test_a_matrix_that_is_none_is_refused(tmp_path, row):
    path = nifti(header_of(qform=0), tmp_path / "a.nii", srow_x=row, srow_y=[0, 0, 0, 0])
    with pytest.raises(InputError, match=r"axes that are not finite|voxels of .* mm; set the|not at right"):
        read_image(path)


def test_a_damaged_qform_is_refused_where_it_counts(tmp_path):
    image = header_of(sform=0)
    with pytest.raises(InputError, match="damaged orientation"):
        read_image(nifti(image, tmp_path / "a.nii", quatern_b=np.nan))
    require_block(read_image(nifti(header_of(), tmp_path / "b.nii", quatern_b=np.nan)))


@pytest.mark.parametrize(("unit", "mm"), [("meter", 1000), ("mm", 1), ("micron", 0.001), ("unknown", 1)])
def test_units_of_nifti_count(tmp_path, unit, mm):
    image = header_of(np.diag([*np.array(STEPS) / mm, 1]))
    image.header.set_xyzt_units(unit)
    read = read_image(nifti(image, tmp_path / "a.nii"))
    np.testing.assert_allclose(read.to_lps_mm, RAS @ np.diag([*STEPS, 1]))
    assert read.unit_mm == (None if unit == "unknown" else mm)


@pytest.mark.parametrize(
    ("unit", "mm"),
    [("mm", 1), ("µm", 1e-3), ("um", 1e-3), ("microns", 1e-3), ("cm", 10), ("m", 1000), ("", 1)],
)
def test_units_of_nrrd_count(tmp_path, unit, mm):
    vectors = " ".join(str(tuple(row)).replace(" ", "") for row in (np.diag(STEPS) / mm).tolist())
    fields = {"space_directions": vectors, "space_origin": "(0,0,0)"}
    told = " ".join([f'"{unit}"'] * 3)
    expected = np.diag([*STEPS, 1.0])
    path = nrrd_file(tmp_path / "a.nrrd", **fields, space_units=told)
    np.testing.assert_allclose(read_image(path).to_lps_mm, expected)
    path = nrrd_file(tmp_path / "a.nrrd", **fields, units=told)
    np.testing.assert_allclose(read_image(path).to_lps_mm, expected)
    spacings = " ".join(str(step / mm) for step in STEPS)
    path = nrrd_file(
        tmp_path / "a.nrrd",
        spacings=spacings,
        units=told,
        without=("space directions", "space", "space origin"),
    )
    image = read_image(path)
    np.testing.assert_allclose(image.to_lps_mm, expected)
    assert {remark.topic for remark in image.remarks} == {"orientation", "origin"}
    assert image.unit_mm == (mm if unit else None)


REFUSED = {
    "unit": (
        {"space_units": '"pixel" "pixel" "pixel"'},
        "gives its size in 'pixel, pixel, pixel'; export it in mm",
    ),
    "nan": ({"space_directions": "(nan,0,0) (0,1,0) (0,0,1)"}, "axes that are not finite numbers"),
    "none": ({"space_directions": "none none none"}, "two-dimensional|how large its voxels are"),
    "zero": ({"space_directions": "(0,0,0) (0,1,0) (0,0,1)"}, "voxels of 0 x 1 x 1 mm; set the spacing"),
    "flat space": ({"space_directions": "(1,0) (0,1) (1,1)"}, "not three-dimensional"),
    "units": (
        {"space_units": '"mm" "m" "mm"'},
        r"has axes in different units \(mm, m, mm\); export it in mm",
    ),
    "words": (
        {"space_directions": "(1;0;0) (0;1;0) (0;0;1)"},
        r"damaged header: 'space directions: \(1;0;0\) .*' gives no numbers; export it again",
    ),
    "letters": ({"sizes": "a b c"}, "damaged header: 'sizes: a b c' gives no numbers; export it again"),
    "letter": ({"dimension": "x"}, "damaged header: 'dimension: x' gives no numbers; export it again"),
    "comma": ({"space_origin": "(1;5,0,0)"}, r"'space origin: \(1;5,0,0\)' gives no numbers"),
    "no type": ({"type": "voxel"}, "has voxels of the unknown type 'voxel'; export it again"),
    "sizes": ({"sizes": "20 24"}, "does not say how many voxels"),
    "beyond measure": (
        {"space_directions": "(1e200,0,0) (0,1,0) (0,0,1)"},
        "axes that are not finite numbers",
    ),
    "huge": ({"sizes": "99999999 99999999 99999999"}, "more than 1,024 MB; crop"),
    "beyond": ({"sizes": "99999999999999999999 3 3"}, "it is damaged, export it again"),
    "negative": ({"sizes": "-20 24 16"}, "it is damaged, export it again"),
    "more": ({"sizes": "20 24 17"}, r"cut off: it announces 8,160 bytes of voxels and has 7,680"),
    "type": ({"type": "rgb"}, "unknown type"),
    "hex": ({"encoding": "hex"}, "is encoded as 'hex'; export it as one of"),
    "gzip": ({"encoding": "gzip"}, "damaged|cut off"),
    "skip": ({"byte_skip": "99999999999999"}, "byte skip"),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_an_nrrd_file_that_cannot_be_right_is_refused(tmp_path, kind, capfd):
    fields, match = REFUSED[kind]
    with pytest.raises(InputError, match=match):
        read_image(nrrd_file(tmp_path / "a.nrrd", **fields))
    assert capfd.readouterr() == ("", "")


def test_an_nrrd_file_without_spacing_is_refused(tmp_path):
    for changed in ({}, {"spacings": "nan nan nan"}, {"spacings": "1 nan 1"}):
        path = nrrd_file(tmp_path / "a.nrrd", without=("space directions",), **changed)
        with pytest.raises(InputError, match=r"a\.nrrd (does not say how large its voxels|is a two-dimen)"):
            read_image(path)


# --- voxels -------------------------------------------------------------------------------------


def test_scaled_whole_numbers_are_what_is_meant(tmp_path):
    path = nifti(header_of(voxels=block().astype(np.int16)), tmp_path / "a.nii", scl_slope=0.5, scl_inter=3.0)
    image = read_image(path)
    np.testing.assert_allclose(
        image.voxels[0] * image.slope + image.intercept, nibabel.Nifti1Image.from_filename(path).get_fdata()
    )
    for slope in (0.0, np.nan):
        image = read_image(nifti(header_of(), path, scl_slope=slope, scl_inter=7.0))
        assert (image.slope, image.intercept) == (1, 0)
    with pytest.raises(InputError, match="cannot be scaled"):
        read_image(nifti(header_of(), path, scl_slope=2.0, scl_inter=np.nan))


def test_other_than_one_number_a_voxel_is_refused(tmp_path):
    colours = np.zeros(SIZE, [("R", "u1"), ("G", "u1"), ("B", "u1")])
    (tmp_path / "rgb.nii").write_bytes(nibabel.Nifti1Image(colours, affine()).to_bytes())
    (tmp_path / "complex.nii").write_bytes(
        nibabel.Nifti1Image(np.ones(SIZE, np.complex64), affine()).to_bytes()
    )
    for name in ("rgb.nii", "complex.nii"):
        with pytest.raises(InputError, match=f"{name} holds colours or complex numbers"):
            read_image(tmp_path / name)
    for shape in ((5, 5, 5, 3), (5, 5, 5, 1, 3)):
        (tmp_path / "time.nii").write_bytes(
            nibabel.Nifti1Image(np.ones(shape, np.uint8), affine()).to_bytes()
        )
        with pytest.raises(InputError, match=r"time\.nii holds 3 values a voxel"):
            read_image(tmp_path / "time.nii")
    for kind in ("none (1,0,0) (0,1,0) (0,0,1)", "(1,0,0) (0,1,0) (0,0,1) none"):
        shape = (3, 5, 5, 5) if kind.startswith("none") else (5, 5, 5, 3)
        path = nrrd_file(tmp_path / "a.nrrd", np.ones(shape, np.uint8), dimension="4", space_directions=kind)
        with pytest.raises(InputError, match=r"a\.nrrd holds 3 values a voxel"):
            read_image(path)


def test_a_fourth_axis_of_one_is_no_matter(tmp_path):
    (tmp_path / "a.nii").write_bytes(nibabel.Nifti1Image(block()[..., None], affine()).to_bytes())
    require_block(read_image(tmp_path / "a.nii"))


def cut_files(tmp_path) -> dict[str, bytes]:
    raw = np.random.default_rng(0).integers(0, 2, SIZE).astype(np.int16)
    plain = header_of(voxels=raw).to_bytes()
    packed = nrrd_file(tmp_path / "x.nrrd", raw, encoding="gzip", data=gzip.compress(raw.tobytes("F")))
    return {
        "a.nii": plain,
        "a.nii.gz": gzip.compress(plain),
        "b.nii": header_of(voxels=raw, kind=nibabel.Nifti2Image).to_bytes(),
        "gz.nrrd": packed.read_bytes(),
        "raw.nrrd": nrrd_file(tmp_path / "x.nrrd", raw).read_bytes(),
        "bz2.nrrd": nrrd_file(
            tmp_path / "x.nrrd", raw, encoding="bz2", data=bz2.compress(raw.tobytes("F"))
        ).read_bytes(),
    }


@pytest.mark.parametrize("name", ["a.nii", "a.nii.gz", "b.nii", "gz.nrrd", "raw.nrrd", "bz2.nrrd"])
def test_a_file_that_was_cut_is_never_read(tmp_path, name, capfd):
    whole = cut_files(tmp_path)[name]
    for left in (1, 10, 200, 351, 600, len(whole) // 2, len(whole) - 9, len(whole) - 1):
        (tmp_path / name).write_bytes(whole[:left])
        with pytest.raises(InputError, match=name):
            read_image(tmp_path / name)
    assert capfd.readouterr() == ("", "")


def test_a_flipped_bit_in_a_packed_file_is_noticed(tmp_path):
    packed = bytearray(gzip.compress(header_of().to_bytes()))
    packed[-6] ^= 1  # in the checksum
    (tmp_path / "a.nii.gz").write_bytes(bytes(packed))
    with pytest.raises(InputError, match=r"a\.nii\.gz is damaged"):
        read_image(tmp_path / "a.nii.gz")


def test_a_small_file_cannot_fill_the_memory(tmp_path):
    zeros = zlib.compressobj(9, wbits=31)
    many = b"".join(zeros.compress(bytes(1 << 20)) for _ in range(64)) + zeros.flush()
    path = nrrd_file(tmp_path / "a.nrrd", encoding="gzip", data=many)
    assert not read_image(path).voxels.any()
    huge = nifti(header_of(), tmp_path / "a.nii", dim=[3, 32767, 32767, 32767, 1, 1, 1, 1])
    with pytest.raises(InputError, match=r"announces 32767 x 32767 x 32767 voxels, more than 1,024 MB"):
        read_image(huge)


@pytest.mark.parametrize("dim", [[3, -5, 5, 5], [3, 0, 5, 5], [0, 5, 5, 5], [9, 5, 5, 5], [-1, 5, 5, 5]])
def test_dimensions_that_are_none_are_refused(tmp_path, dim):
    path = nifti(header_of(), tmp_path / "a.nii", dim=[*dim, 1, 1, 1, 1])
    with pytest.raises(InputError, match=r"a\.nii .*(damaged|cut off)"):
        read_image(path)


@pytest.mark.parametrize("code", [0, 1, 57, 10512])
def test_a_type_that_is_none_is_refused(tmp_path, code):
    path = nifti(header_of(), tmp_path / "a.nii", datatype=code)
    with pytest.raises(InputError, match=r"unknown type|colours or complex"):
        read_image(path)


@pytest.mark.parametrize("offset", [0, 16, np.nan, np.inf, -5, 1e9])
def test_where_voxels_begin_is_looked_at(tmp_path, offset):
    path = nifti(header_of(), tmp_path / "a.nii", vox_offset=offset)
    if offset in (0, 16):
        require_block(read_image(path))
    else:
        with pytest.raises(InputError, match=r"where its voxels begin|cut off"):
            read_image(path)


# --- what is no image ---------------------------------------------------------------------------

OTHER = {
    "a.dcm": (bytes(128) + b"DICM", "a DICOM file; convert the series"),
}


@pytest.mark.parametrize("name", OTHER)
def test_other_formats_are_named(tmp_path, name):
    content, match = OTHER[name]
    (tmp_path / name).write_bytes(content)
    assert is_image(tmp_path / name)
    with pytest.raises(InputError, match=match):
        read_image(tmp_path / name)


def test_what_is_no_image_is_told_apart(tmp_path):
    for name, content, match in (
        ("zip.nii", b"PK\x03\x04rest", "a zip archive; unpack it"),
        ("page.nii.gz", b"<!DOCTYPE html><html>", "a web page; download the file itself"),
        ("mesh.nrrd", b"solid a\nfacet normal 0 0 1\n", "holds no NIfTI, Analyze, NRRD or MetaImage"),
        (
            "triangles.nii",
            bytes(80) + struct.pack("<I", 9) * 40,
            "holds no NIfTI, Analyze, NRRD or MetaImage",
        ),
        ("empty.nii", b"", "is empty"),
    ):
        (tmp_path / name).write_bytes(content)
        assert not is_image(tmp_path / name)
        with pytest.raises(InputError, match=match):
            read_image(tmp_path / name)
    with pytest.raises(InputError, match="is a folder"):
        read_image(tmp_path)
    (tmp_path / "loop.nii").symlink_to(tmp_path / "loop.nii")
    with pytest.raises(InputError, match=r"loop\.nii"):
        read_image(tmp_path / "loop.nii")
