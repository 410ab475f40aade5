"""Opening any path, and telling what is in a file whatever its name says."""

from __future__ import annotations

import gzip
import io
import os
import socket
import zipfile
from pathlib import Path

import pytest
from shapes import binary_stl, block, text_stl

from naisr_model.data.formats import content_of
from naisr_model.data.meshes import read_mesh
from naisr_model.data.patients import read_patient
from naisr_model.errors import InputError
from naisr_model.files import require_file


def zipped(name: str, content: bytes) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr(name, content)
    return file.getvalue()


def test_what_is_no_file_is_named(tmp_path):
    (tmp_path / "folder.stl").mkdir()
    os.mkfifo(tmp_path / "pipe.stl")
    (tmp_path / "loop.stl").symlink_to(tmp_path / "loop.stl")
    (tmp_path / "lost.stl").symlink_to(tmp_path / "gone.stl")
    (tmp_path / "empty.stl").write_bytes(b"")
    (tmp_path / "file").write_bytes(b"x")
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(tmp_path / "s"))
    said = {
        "folder.stl": "is a folder",
        "pipe.stl": "is a pipe",
        "s": "is a socket",
        "loop.stl": "is a link that leads back to itself",
        "lost.stl": "is a link to .*gone.stl, which does not exist",
        "gone.stl": "does not exist; correct the path",
        "empty.stl": r"is empty \(0 bytes\)",
        "file/a.stl": "a part of it is a file and no folder",
        "x" * 300: "cannot be read",
        "a\0b.stl": "is no path",
    }
    for name, match in said.items():
        for read in (require_file, content_of, read_mesh, read_patient):
            with pytest.raises(InputError, match=match):
                read(tmp_path / name)
    with pytest.raises(InputError, match="is a device"):
        read_mesh("/dev/null")


@pytest.mark.skipif(os.geteuid() == 0, reason="the superuser may read anything")
def test_what_may_not_be_read_is_named(tmp_path):
    path = tmp_path / "mine.stl"
    path.write_bytes(b"x")
    path.chmod(0)
    with pytest.raises(InputError, match="may not be read by you"):
        read_mesh(path)


FOREIGN = {
    "page.stl": (b"<!DOCTYPE html>\n<html><body>404</body></html>", "is a web page; download the file"),
    "old page.stl": (b"\n <HTML><HEAD></HEAD>", "is a web page"),
    "zip.stl": (zipped("a.stl", b"solid"), "is a zip archive; unpack it"),
    "print.stl": (zipped("3D/3dmodel.model", b"<model/>"), "is a 3MF file; save it as STL"),
    "packed.stl": (gzip.compress(binary_stl(block())), "is compressed with gzip; unpack it"),
    "report.stl": (b"%PDF-1.7\n%\xe2\xe3", "is a PDF document"),
    "picture.ply": (b"\x89PNG\r\n\x1a\n" + bytes(200), r"is a picture \(PNG\)"),
    "photo.obj": (b"\xff\xd8\xff\xe0" + bytes(200), r"is a picture \(JPEG\)"),
    "scan.stl": (bytes(128) + b"DICM" + bytes(100), "is a DICOM"),
    "volume.stl": (
        b"NRRD0004\ntype: short\n" + bytes(100),
        "is an NRRD volume; name it .nrrd|how many voxels",
    ),
    "brain.stl": (
        bytes(344) + b"n+1\0" + bytes(100),
        "is a NIfTI volume; name it .nii|announces 0 dimensions",
    ),
    "scene.glb": (b'{"asset": {"version": "2.0"}}', "is glTF as text; save it as GLB"),
    "model.stl": (b'<?xml version="1.0"?>\n<COLLADA version="1.4"/>', "is a COLLADA file; save it as"),
    "strange.vtp": (b'<?xml version="1.0"?>\n<recipe/>', r"is an XML file \('recipe'\)"),
    "words.stl": (b"this is no mesh\n" * 9, r"is no STL file \(it begins with 'this is no mesh'\)"),
    "zeros.stl": (bytes(4096), "nothing but zeros"),
    "lfs.ply": (b"version https://git-lfs.github.com/spec/v1\n", "is a pointer of Git LFS"),
    "atlas.stl": (
        (64).to_bytes(8, "little") + b'{"weights":{"dtype":"F32","shape":[64]' + bytes(400),
        "is an atlas or another .safetensors file; name it so",
    ),
    "mesh.off.stl": (b"OFF\n8 6 0\n", "is an OFF file"),
}


@pytest.mark.parametrize("name", FOREIGN)
def test_what_is_no_mesh_is_named_with_what_to_do(tmp_path, name, capfd):
    content, match = FOREIGN[name]
    (tmp_path / name).write_bytes(content)
    for read in (read_mesh, read_patient):
        with pytest.raises(InputError, match=match) as error:
            read(tmp_path / name)
        assert str(error.value).startswith(name) and "\n" not in str(error.value)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    "name", ["mesh.ply", "mesh.obj", "mesh.vtp", "mesh.glb", "mesh.xyz", "mesh", "mesh.dat"]
)
@pytest.mark.parametrize("content", [binary_stl(block()), text_stl(block()).encode()], ids=["binary", "text"])
def test_the_content_counts_and_not_the_name(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    patient = read_patient(tmp_path / name)
    assert patient.mesh_mm.volume == pytest.approx(240_000)
    assert [(remark.severity, remark.topic) for remark in patient.remarks] == [("fine", "name")]
    assert "STL" in patient.remarks[0].text


def test_a_name_of_bytes_that_are_no_text_is_read(tmp_path):
    path = Path(os.fsdecode(os.fsencode(tmp_path) + b"/p\xff.stl"))
    path.write_bytes(binary_stl(block()))
    assert read_mesh(path).volume == pytest.approx(240_000)
