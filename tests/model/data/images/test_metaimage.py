"""MetaImages as ITK's programs write them; the truth is what was put in, and what nibabel writes of it."""

from __future__ import annotations

import zlib

import nibabel
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from naisr_model.data.images.reading import is_image, read_image
from naisr_model.data.volumes import is_label_volume, read_labels
from naisr_model.errors import InputError

RAS = np.diag([-1.0, -1.0, 1.0, 1.0])
TURN = Rotation.from_euler("xyz", [20, -35, 50], degrees=True).as_matrix()
STEPS = (1.5, 0.7, 2.5)
ORIGIN = (10.0, -20.0, 300.0)


def block(kind="u1") -> np.ndarray:
    voxels = np.zeros((20, 24, 16), kind)
    voxels[3:9, 5:15, 2:12] = 2
    voxels[4, 6, 3] = 1  # tells the corners apart
    return voxels


def lps() -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = TURN * STEPS, ORIGIN
    return matrix


def words(numbers) -> str:
    return " ".join(repr(float(number)) for number in np.ravel(numbers))


def written(path, voxels=None, data=None, end="\n", without=(), **changed):
    """Bytes by hand, as ITK 5 orders them; the voxels inside unless ``ElementDataFile`` says otherwise."""
    voxels = block() if voxels is None else voxels
    kinds = {"i1": "CHAR", "u1": "UCHAR", "i2": "SHORT", "u2": "USHORT", "i4": "INT", "u4": "UINT"}
    kinds |= {"i8": "LONG_LONG", "u8": "ULONG_LONG", "f4": "FLOAT", "f8": "DOUBLE"}
    fields = {
        "ObjectType": "Image",
        "NDims": "3",
        "BinaryData": "True",
        "BinaryDataByteOrderMSB": "False",
        "CompressedData": "False",
        "TransformMatrix": words(TURN.T),  # a row for each axis
        "Offset": words(ORIGIN),
        "CenterOfRotation": "0 0 0",
        "AnatomicalOrientation": "RAI",
        "ElementSpacing": words(STEPS),
        "DimSize": " ".join(map(str, voxels.shape)),
        "ElementType": f"MET_{kinds[voxels.dtype.str[1:]]}",
    }
    fields |= {"ElementDataFile": "LOCAL"} | changed
    fields["ElementDataFile"] = fields.pop("ElementDataFile")  # the last one
    lines = [f"{name} = {value}" for name, value in fields.items() if name not in without]
    content = voxels.tobytes(order="F") if data is None else data
    path.write_bytes((end.join(lines) + end).encode() + content)
    return path


def require_block(image) -> None:
    np.testing.assert_array_equal(image.voxels[0], block())
    np.testing.assert_allclose(image.to_lps_mm, lps(), atol=1e-9)
    assert image.remarks == ()


@pytest.mark.parametrize("kind", ["i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "f4", "f8"])
@pytest.mark.parametrize("order", ["<", ">"])
def test_every_type_is_read_in_both_byte_orders(tmp_path, kind, order):
    voxels = block(f"{order}{kind}")
    big = str(order == ">")
    require_block(read_image(written(tmp_path / "a.mha", voxels, BinaryDataByteOrderMSB=big)))


@pytest.mark.parametrize("name", ["a.mha", "a.nii.gz", "a.stl", "a"])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_it_is_known_by_what_it_holds(tmp_path, name, end):
    path = written(tmp_path / name, end=end, Comment="an airway")
    assert is_image(path) and is_label_volume(path)
    require_block(read_image(path))
    content = path.read_bytes()
    path.write_bytes(b"Comment = a line of the user\n" + content.replace(b"ObjectType = Image\n", b"", 1))
    assert is_image(path)
    require_block(read_image(path))


def test_it_equals_the_same_volume_in_nifti(tmp_path):
    image = nibabel.Nifti1Image(block(), RAS @ lps())
    image.header.set_xyzt_units("mm")
    nibabel.save(image, tmp_path / "a.nii.gz")
    one, other = (
        read_labels(path) for path in (written(tmp_path / "a.mha", DistanceUnits="mm"), tmp_path / "a.nii.gz")
    )
    np.testing.assert_array_equal(one.labels, other.labels)
    np.testing.assert_allclose(one.to_lps_mm, other.to_lps_mm, atol=1e-4)
    assert one.unit_mm == other.unit_mm == 1.0


def test_voxels_beside_the_header_and_packed_ones_are_found(tmp_path):
    raw = block().tobytes("F")
    (tmp_path / "my voxels.raw").write_bytes(b"skip" + raw)
    apart = {"data": b"", "ElementDataFile": "my voxels.raw"}
    require_block(read_image(written(tmp_path / "a.mhd", **apart, HeaderSize="4")))
    require_block(read_image(written(tmp_path / "a.mhd", **apart, HeaderSize="-1")))
    (tmp_path / "a.zraw").write_bytes(zlib.compress(raw))
    packed = {"CompressedData": "True", "CompressedDataSize": str(len(zlib.compress(raw)))}
    require_block(read_image(written(tmp_path / "a.mhd", data=b"", ElementDataFile="a.zraw", **packed)))
    require_block(read_image(written(tmp_path / "a.mha", data=zlib.compress(raw), **packed)))
    (tmp_path / "a.zraw").unlink()
    with pytest.raises(InputError, match=r"a\.mhd has its voxels in a\.zraw, which is not there; keep both"):
        read_image(tmp_path / "a.mhd")


@pytest.mark.parametrize(("unit", "mm"), [("um", 1e-3), ("mm", 1), ("cm", 10), ("?", None)])
def test_units_count(tmp_path, unit, mm):
    image = read_image(written(tmp_path / "a.mha", DistanceUnits=unit))
    np.testing.assert_allclose(image.to_lps_mm[:3], (mm or 1) * lps()[:3], rtol=1e-12)
    assert image.unit_mm == mm


@pytest.mark.parametrize(
    ("other", "usual"),
    [("Orientation", "TransformMatrix"), ("Position", "Offset"), ("ElementSize", "ElementSpacing")],
)
def test_older_names_of_fields_are_known(tmp_path, other, usual):
    told = {"TransformMatrix": words(TURN.T), "Offset": words(ORIGIN), "ElementSpacing": words(STEPS)}
    require_block(read_image(written(tmp_path / "a.mha", without=(usual,), **{other: told[usual]})))


def test_what_it_does_not_say_is_told(tmp_path):
    image = read_image(written(tmp_path / "a.mha", without=("TransformMatrix", "Offset")))
    assert [remark.topic for remark in image.remarks] == ["orientation", "origin"]
    np.testing.assert_allclose(image.to_lps_mm, np.diag([*STEPS, 1]))
    image = read_image(written(tmp_path / "a.mha", data=block().tobytes("F") + b"more"))
    assert [remark.topic for remark in image.remarks] == ["surplus"]


def test_rounded_directions_do_not_change_the_size_of_voxels(tmp_path):
    image = read_image(written(tmp_path / "a.mha", TransformMatrix=words(TURN.T.round(3))))
    np.testing.assert_allclose(np.linalg.norm(image.to_lps_mm[:3, :3], axis=0), STEPS, rtol=1e-12)
    np.testing.assert_allclose(image.to_lps_mm[:3, :3], lps()[:3, :3], atol=2e-3)


REFUSED = {
    "several files": ({"ElementDataFile": "LIST"}, r"in several files \(LIST\); save them as one"),
    "a pattern": ({"ElementDataFile": "a%02d.raw 1 9 1"}, "in several files"),
    "no file": ({"ElementDataFile": ""}, "does not say where its voxels are"),
    "text": ({"BinaryData": "False"}, "writes its voxels as text; save it as binary"),
    "colours": ({"ElementNumberOfChannels": "3"}, "holds 3 values a voxel; save one label volume alone"),
    "channels": ({"ElementNumberOfChannels": "many"}, "gives no number; export it again"),
    "type": ({"ElementType": "MET_STRING"}, "voxels of the unknown type 'MET_STRING'; export it again"),
    "a tube": ({"ObjectType": "Tube"}, "holds no image but a 'Tube'; save the label volume itself"),
    "dimensions": ({"NDims": "x"}, "does not say how many voxels it has"),
    "two": ({"NDims": "2"}, "gives no 2 numbers; export it again"),
    "sizes": ({"DimSize": "20 24"}, "damaged header: 'DimSize = 20 24' gives no 3 numbers"),
    "nan size": ({"DimSize": "nan 24 16"}, "gives no 3 numbers"),
    "negative": ({"DimSize": "-20 24 16"}, "it is damaged, export it again"),
    "beyond": ({"DimSize": "1e300 24 16"}, "more than 1,024 MB; crop"),
    "more": ({"DimSize": "20 24 17"}, "cut off: it announces 8,160 bytes of voxels and has 7,680"),
    "flat": ({"DimSize": "20 384 1"}, "a two-dimensional image"),
    "spacing": ({"ElementSpacing": "1 0 1"}, "voxels of 1 x 0 x 1 mm; set the spacing"),
    "minus": ({"ElementSpacing": "1 -1 1"}, "voxels of 1 x -1 x 1 mm; set the spacing"),
    "nan": ({"ElementSpacing": "1 nan 1"}, "gives no 3 numbers"),
    "comma": ({"Offset": "1,5 0 0"}, "'Offset = 1,5 0 0' gives no 3 numbers; export it again"),
    "long axes": ({"TransformMatrix": words(2 * TURN)}, "axes of the lengths 2, 2, 2 where 1 is meant"),
    "no axes": ({"TransformMatrix": "0 0 0 0 0 0 0 0 0"}, "axes of the lengths 0, 0, 0"),
    "sheared": ({"TransformMatrix": "1 0 0 0.0349 0.9994 0 0 0 1"}, "not at right angles; resample"),
    "packed": ({"CompressedData": "True"}, "damaged|cut off"),
    "skip": ({"ElementDataFile": "a.raw", "HeaderSize": "1e300"}, "cut off"),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_one_that_cannot_be_right_is_refused(tmp_path, kind, capfd):
    fields, match = REFUSED[kind]
    (tmp_path / "a.raw").write_bytes(block().tobytes("F"))
    with pytest.raises(InputError, match=match):
        read_image(written(tmp_path / "a.mha", **fields))
    assert capfd.readouterr() == ("", "")


def test_one_without_spacing_or_an_end_is_refused(tmp_path):
    with pytest.raises(InputError, match="does not say how large its voxels are"):
        read_image(written(tmp_path / "a.mha", without=("ElementSpacing",)))
    whole = written(tmp_path / "a.mha").read_bytes()
    for left in (60, 300, len(whole) // 2, len(whole) - 1):
        (tmp_path / "a.mha").write_bytes(whole[:left])
        with pytest.raises(InputError, match=r"a\.mha"):
            read_image(tmp_path / "a.mha")
