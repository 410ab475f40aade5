"""Pairs of header and image, as nibabel writes them and reads them again."""

from __future__ import annotations

import gzip
from typing import Any

import nibabel
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from naisr_model.data.images.reading import is_image, read_image
from naisr_model.data.volumes import read_labels
from naisr_model.errors import InputError

RAS = np.diag([-1.0, -1.0, 1.0, 1.0])
KINDS = {
    "NIfTI": nibabel.Nifti1Pair,
    "NIfTI-2": nibabel.nifti2.Nifti2Pair,
    "Analyze": nibabel.AnalyzeImage,
    "SPM": nibabel.Spm2AnalyzeImage,
}
PLACED = ("NIfTI", "NIfTI-2")


def block() -> np.ndarray:
    voxels = np.zeros((20, 24, 16), np.int16)
    voxels[3:9, 5:15, 2:12] = 2
    voxels[4, 6, 3] = 1  # tells the corners apart
    return voxels


def pair(kind: str, folder, order="<"):
    """The header of a pair, whose axes nibabel may turn as the format allows it."""
    turn = Rotation.from_euler("xyz", [20, -35, 50], degrees=True).as_matrix()
    matrix = np.diag([-1.5, 0.7, 2.5, 1.0])
    if kind in PLACED:
        matrix[:3, :3] = turn @ matrix[:3, :3]
        matrix[:3, 3] = 10, -20, 300
    header = KINDS[kind].header_class(endianness=order)
    header.set_data_dtype(np.dtype("i2").newbyteorder(order))
    image = KINDS[kind](block(), matrix, header)
    image.to_filename(folder / "a.hdr")
    (folder / "a.mat").unlink(missing_ok=True)  # of SPM, whose place of the first voxel nobody else knows
    return folder / "a.hdr"


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("kind", KINDS)
def test_a_pair_is_read_by_either_file_as_nibabel_reads_it(tmp_path, kind, order):
    path = pair(kind, tmp_path, order)
    truth: Any = nibabel.load(path)
    for each in (path, path.with_suffix(".img")):
        assert is_image(each)
        image = read_image(each)
        np.testing.assert_array_equal(image.voxels[0] * image.slope + image.intercept, truth.get_fdata())
        np.testing.assert_allclose(RAS @ image.to_lps_mm, truth.affine, atol=1e-4)
        assert [remark.topic for remark in image.remarks] == ([] if kind in PLACED else ["orientation"])
        assert set(np.unique(read_labels(each).labels)) == {0, 1, 2}


def test_names_in_capitals_and_packed_halves_are_found(tmp_path):
    path = pair("NIfTI", tmp_path)
    header, image = path.read_bytes(), path.with_suffix(".img").read_bytes()
    for number, (first, second) in enumerate(
        [("b.HDR", "b.IMG"), ("b.hdr.gz", "b.img.gz"), ("b.hdr", "b.img.gz"), ("b.2.hdr", "b.2.img")]
    ):
        folder = tmp_path / str(number)
        folder.mkdir()
        for name, content in ((first, header), (second, image)):
            (folder / name).write_bytes(gzip.compress(content) if name.endswith("gz") else content)
            assert is_image(folder / first)
        for name in (first, second):
            np.testing.assert_array_equal(read_image(folder / name).voxels[0], block())


def test_one_half_alone_and_halves_that_do_not_match_are_refused(tmp_path, capfd):
    path = pair("NIfTI", tmp_path)
    image = path.with_suffix(".img")
    whole = image.read_bytes()
    image.write_bytes(whole[:-1])
    with pytest.raises(
        InputError, match=r"a\.img is cut off: it announces 15,360 bytes of voxels and has 15"
    ):
        read_image(path)
    image.write_bytes(whole + b"more")
    assert [remark.topic for remark in read_image(path).remarks] == ["surplus"]
    image.unlink()
    with pytest.raises(
        InputError, match=r"a\.hdr is the header of a pair, and its image \(\.img\) is not th"
    ):
        read_image(path)
    path.unlink()
    image.write_bytes(whole)
    assert not is_image(image)
    with pytest.raises(InputError, match=r"a\.img is the image of a pair, and its header \(\.hdr\) is not"):
        read_image(image)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("field", "value"), [("dim", [3, 99, 99, 99, 1, 1, 1, 1]), ("pixdim", [1.0] + [0] * 7)]
)
def test_a_damaged_header_of_analyze_is_refused(tmp_path, field, value):
    path = pair("Analyze", tmp_path)
    header = nibabel.AnalyzeImage.header_class(path.read_bytes(), check=False)
    header[field] = value
    path.write_bytes(header.binaryblock)
    with pytest.raises(InputError, match=r"cut off|voxels of 0 x 0 x 0 mm; set the spacing"):
        read_image(path)
