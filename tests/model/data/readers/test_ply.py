"""PLY with polygons of any size, further lists, strips and every kind of number."""

from __future__ import annotations

import struct

import pytest
from shapes import block

from naisr_model.data.meshes import read_mesh
from naisr_model.data.patients import read_patient
from naisr_model.errors import InputError

CORNERS = [(x, y, z) for z in (0, 3) for y in (0, 2) for x in (0, 1)]
"""Of a box of 1 x 2 x 3."""
MIXED = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7], [1, 7, 5]]
"""Its sides, the last as two triangles."""


def header(format: str, rows: int, *faces: str, points: int = 8, element: str = "face") -> str:
    names = "".join(f"property float {axis}\n" for axis in "xyz")
    lines = "".join(f"property {face}\n" for face in faces)
    start = f"ply\nformat {format} 1.0\ncomment by hand\nelement vertex {points}\n{names}"
    return f"{start}element {element} {rows}\n{lines}end_header\n"


def packed(order: str, faces, labels=None) -> bytes:
    body = b"".join(struct.pack(f"{order}3f", *corner) for corner in CORNERS)
    for number, face in enumerate(faces):
        body += struct.pack(f"{order}B{len(face)}i", len(face), *face)
        if labels is not None:
            body += struct.pack(f"{order}B{len(labels[number])}d", len(labels[number]), *labels[number])
    return body


INDICES = "list uchar int vertex_indices"
UV = "list uchar double texcoord"
LABELS = [[0.5] * (number % 3) for number in range(len(MIXED))]
FILES = {
    "little": header("binary_little_endian", 7, INDICES).encode() + packed("<", MIXED),
    "big": header("binary_big_endian", 7, INDICES).encode() + packed(">", MIXED),
    "lists": header("binary_little_endian", 7, INDICES, UV).encode() + packed("<", MIXED, LABELS),
    "text": (
        header("ascii", 7, INDICES)
        + "\n".join(" ".join(map(str, corner)) for corner in CORNERS)
        + "\n"
        + "\n".join(" ".join(map(str, [len(face), *face])) for face in MIXED)
        + "\n"
    ).encode(),
    "returns": header("binary_little_endian", 7, INDICES).replace("\n", "\r\n").encode() + packed("<", MIXED),
    "strip": (
        header("ascii", 1, "list int int vertex_indices", element="tristrips")
        + "\n".join(" ".join(map(str, corner)) for corner in CORNERS)
        + "\n24 0 2 1 3 -1 4 5 6 7 -1 0 1 4 5 -1 2 6 3 7 -1 0 4 2 6 -1 1 3 5 7".replace("24", "29")
    ).encode(),
}


@pytest.mark.parametrize("kind", FILES)
def test_every_way_of_writing_faces_is_read(tmp_path, kind):
    (tmp_path / "box.ply").write_bytes(FILES[kind])
    mesh = read_mesh(tmp_path / "box.ply")
    assert len(mesh.faces) == 12 and mesh.is_watertight and mesh.is_winding_consistent
    assert abs(mesh.volume) == pytest.approx(6.0)


@pytest.mark.parametrize("kind", ["little", "lists", "text"])
def test_a_file_that_was_cut_off_says_how_much_there_is(tmp_path, kind):
    whole = FILES[kind].rstrip()
    for cut in range(1, 12):
        (tmp_path / "box.ply").write_bytes(whole[:-cut] if kind != "text" else whole[: -2 * cut])
        with pytest.raises(InputError, match=r"cut off: it announces 7 rows of 'face' and holds \d;"):
            read_mesh(tmp_path / "box.ply")
    at = whole.index(b"end_header") + 40
    (tmp_path / "box.ply").write_bytes(whole[:at])
    with pytest.raises(InputError, match="announces 8 rows of 'vertex' and holds"):
        read_mesh(tmp_path / "box.ply")
    (tmp_path / "box.ply").write_bytes(whole[:60])
    with pytest.raises(InputError, match="its header has no end"):
        read_mesh(tmp_path / "box.ply")


def test_bytes_after_the_end_are_left_out_and_said(tmp_path):
    path = tmp_path / "block.ply"
    path.write_bytes(block().export(file_type="ply") + b"signature")
    patient = read_patient(path)
    assert patient.mesh_mm.volume == pytest.approx(240_000)
    assert [remark.topic for remark in patient.remarks] == ["trailing"]


def test_lines_are_no_surface(tmp_path):
    edges = header("ascii", 2, "int vertex1", "int vertex2", points=60, element="edge")
    points = "\n".join(f"{i} {i * i} 0" for i in range(60))
    (tmp_path / "lines.ply").write_text(edges + points + "\n0 1\n1 2\n")
    with pytest.raises(InputError, match=r"lines\.ply holds lines, no surface"):
        read_patient(tmp_path / "lines.ply")


@pytest.mark.parametrize(
    "line", ["format ascii_text 1.0", "element face many", "property list uchar int", "property real x"]
)
def test_a_header_that_is_not_understood_names_the_line(tmp_path, line):
    (tmp_path / "odd.ply").write_text(f"ply\nformat ascii 1.0\nelement vertex 1\n{line}\nend_header\n0 0 0\n")
    with pytest.raises(InputError, match=f"header line '{line}' is not understood"):
        read_mesh(tmp_path / "odd.ply")


def test_a_file_whose_end_was_not_copied_is_refused(tmp_path):
    whole = FILES["little"]
    (tmp_path / "box.ply").write_bytes(whole[:-80] + bytes(80))
    with pytest.raises(InputError, match="was not copied whole"):
        read_mesh(tmp_path / "box.ply")
