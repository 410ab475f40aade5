"""STL as people's programs write it."""

from __future__ import annotations

import numpy as np
import pytest
from shapes import binary_stl, block, text_stl

from naisr_model.data.meshes import read_mesh
from naisr_model.data.patients import read_patient
from naisr_model.errors import InputError

VOLUME_MM3 = 240_000


def written(tmp_path, content: bytes | str):
    path = tmp_path / "scan.stl"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


@pytest.mark.parametrize("count", [None, 0, 0xFFFFFFFF])
@pytest.mark.parametrize("header", [b"", b"solid that is binary", b"facet"])
def test_a_count_that_was_not_known_is_taken_from_the_length(tmp_path, count, header):
    mesh = read_mesh(written(tmp_path, binary_stl(block(), count, header)))
    assert len(mesh.faces) == 768 and mesh.volume == pytest.approx(VOLUME_MM3)
    assert mesh.is_watertight, "points that are written once a face are shared"


@pytest.mark.parametrize("share", [0.99, 0.6, 0.2])
def test_a_file_that_was_cut_off_says_how_much_there_is(tmp_path, share):
    content = binary_stl(block())
    path = written(tmp_path, content[: int(share * len(content))])
    held = (int(share * len(content)) - 84) // 50
    for read in (read_mesh, read_patient):
        with pytest.raises(InputError, match=f"cut off: it announces 768 faces and holds {held};"):
            read(path)


@pytest.mark.parametrize("rest", [b"\0", b"made by somebody" * 9, bytes(50)])
def test_what_follows_the_last_face_is_left_out_and_said(tmp_path, rest):
    patient = read_patient(written(tmp_path, binary_stl(block()) + rest))
    assert patient.mesh_mm.volume == pytest.approx(VOLUME_MM3)
    (remark,) = patient.remarks
    assert remark.severity == "fine" and f"{len(rest)} bytes after the end" in remark.text


TEXT = text_stl(block())
WRITINGS = {
    "as the standard has it": TEXT,
    "end loop": TEXT.replace("endloop", "end loop").replace("endfacet", "end facet"),
    "upper case": TEXT.upper(),
    "a mark of Unicode": "\ufeff" + TEXT,
    "a name over lines": TEXT.replace("solid made", "solid\t", 1),
    "carriage returns": TEXT.replace("\n", "\r\n"),
    "indented": "\n\n" + TEXT.replace("\n", "\n\t  "),
    "two solids": TEXT.replace("endloop\nendfacet\n", "endloop\nendfacet\nendsolid a\nsolid b\n", 1),
    "no name": TEXT.replace(" made by hand", ""),
    "end solid": TEXT.replace("endsolid", "end solid"),
    "exponents": TEXT.replace("vertex 20 ", "vertex +2.0E+01 "),
    "words after the end": TEXT + "\n; made by a program\n",
}


@pytest.mark.parametrize("writing", WRITINGS)
def test_text_is_read_however_it_is_written(tmp_path, writing):
    mesh = read_mesh(written(tmp_path, WRITINGS[writing]))
    assert len(mesh.faces) == 768 and mesh.volume == pytest.approx(VOLUME_MM3)
    assert mesh.is_watertight


def test_text_in_utf_16_is_read(tmp_path):
    assert read_mesh(written(tmp_path, TEXT.encode("utf-16"))).volume == pytest.approx(VOLUME_MM3)


def test_a_missing_end_is_read_and_said(tmp_path):
    patient = read_patient(written(tmp_path, TEXT.split("endsolid", maxsplit=1)[0]))
    assert patient.mesh_mm.volume == pytest.approx(VOLUME_MM3)
    assert [(remark.severity, remark.topic) for remark in patient.remarks] == [("look", "ending")]


BROKEN = {
    "a comma": (
        TEXT.replace("vertex 20 ", "vertex 20,0 ", 1),
        r"line \d+ \('vertex 20,0 .*has no three numbers",
    ),
    "two numbers": (TEXT.replace("vertex 20 30 50\n", "vertex 20 30\n", 1), "has no three numbers"),
    "four corners": (TEXT.replace("endloop", "vertex 0 0 0\nendloop", 1), "follows a face of 4 corners"),
    "two corners": (TEXT.replace("vertex 20 30 50\n", "", 1), "follows a face of 2 corners"),
    "cut in a face": (
        TEXT[: TEXT.rindex("vertex")],
        "cut off: it announces 768 faces and the last has 2 corners",
    ),
}


@pytest.mark.parametrize("fault", BROKEN)
def test_text_that_is_not_understood_names_the_line(tmp_path, fault):
    content, match = BROKEN[fault]
    with pytest.raises(InputError, match=match):
        read_mesh(written(tmp_path, content))


def test_no_number_is_not_taken_for_one(tmp_path):
    mesh = block()
    content = binary_stl(mesh)
    at = 84 + 12
    broken = content[:at] + np.array([np.nan, 0, np.inf], "<f4").tobytes() + content[at + 12 :]
    with pytest.raises(InputError, match=r"has 1 of \d+ vertices that are not finite numbers"):
        read_mesh(written(tmp_path, broken))
    with pytest.raises(InputError, match="not finite numbers"):
        read_mesh(written(tmp_path, TEXT.replace("vertex 20 ", "vertex nan ", 1)))


def test_a_file_whose_end_was_not_copied_is_refused(tmp_path):
    content = binary_stl(block())
    with pytest.raises(InputError, match="was not copied whole: 120 faces in a row are zeros"):
        read_mesh(written(tmp_path, content[: -120 * 50] + bytes(120 * 50)))
