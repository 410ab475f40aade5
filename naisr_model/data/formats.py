"""Opening files, and telling what is in them by their content, whatever their name says.

:func:`content_of` opens any path and says in a sentence why it cannot; :func:`format_of` names the format,
and :func:`refuse_foreign` says of what is no shape what it is and what to do with it.
"""

from __future__ import annotations

import codecs
import gzip
import re
import struct
import zlib
from pathlib import Path

from naisr_model.errors import InputError
from naisr_model.files import require_file, why_unreadable

MOST_BYTES = 2 << 30
"""Of one mesh, unpacked; what is longer would not fit into the memory of most computers."""


def content_of(path: str | Path) -> bytes:
    """All bytes of a file.

    Raises:
        InputError: as :func:`~naisr_model.files.require_file`, and when it may not be read or is larger than
            :data:`MOST_BYTES`.
    """
    path = require_file(path)
    try:
        size = path.stat().st_size
        if size > MOST_BYTES:
            raise InputError(f"{path.name} has {size / 2**30:.1f} GiB; thin the surface and export it again")
        return path.read_bytes()
    except OSError as error:
        raise InputError(why_unreadable(path, error)) from error


# --- what it is ---------------------------------------------------------------------------------

MESHES = {"stl": "STL", "ply": "PLY", "obj": "OBJ", "vtk": "VTK", "vtp": "VTP", "glb": "GLB"}
"""The formats of meshes that are read, by their usual endings."""

_MAGIC: tuple[tuple[bytes, str, str], ...] = (
    (b"\x1f\x8b", "compressed with gzip", "unpack it first"),
    (b"BZh", "compressed with bzip2", "unpack it first"),
    (b"\xfd7zXZ\x00", "compressed with xz", "unpack it first"),
    (b"\x28\xb5\x2f\xfd", "compressed with zstd", "unpack it first"),
    (b"7z\xbc\xaf\x27\x1c", "a 7z archive", "unpack it and give the file inside"),
    (b"Rar!", "a RAR archive", "unpack it and give the file inside"),
    (b"%PDF", "a PDF document", "export the surface itself, as STL or PLY"),
    (b"\x89PNG", "a picture (PNG)", "export the surface itself, as STL or PLY"),
    (b"\xff\xd8\xff", "a picture (JPEG)", "export the surface itself, as STL or PLY"),
    (b"GIF8", "a picture (GIF)", "export the surface itself, as STL or PLY"),
    (b"NRRD000", "an NRRD volume", "name it .nrrd"),
    (b"ObjectType = Image", "a MetaImage volume", "name it .mha"),
    (b"Kaydara FBX", "an FBX file", "save it as STL, PLY or OBJ"),
    (b"ISO-10303-21", "a STEP file", "save it as STL, PLY or OBJ"),
    (b"\x89HDF", "an HDF5 file", "export the surface as STL or PLY"),
    (b"version https://git-lfs", "a pointer of Git LFS", "fetch the file itself with 'git lfs pull'"),
    (b"\xd0\xcf\x11\xe0", "an Office document", "export the surface itself, as STL or PLY"),
    (b"BLENDER", "a Blender file", "export the surface as STL or PLY"),
    (b"OFF", "an OFF file", "save it as STL, PLY or OBJ"),
    (b"COFF", "an OFF file", "save it as STL, PLY or OBJ"),
)
_NIFTI = (b"n+1\0", b"ni1\0")
_BEFORE_ROOT = re.compile(rb"\s*(<\?.*?\?>|<!--.*?-->|<!DOCTYPE\s+)", re.DOTALL | re.IGNORECASE)
_ROOT = re.compile(rb"\s*<?\s*([A-Za-z][\w:]*)")
_ROOTS = {
    "html": ("a web page", "download the file itself"),
    "collada": ("a COLLADA file", "save it as STL, PLY or OBJ"),
    "x3d": ("an X3D file", "save it as STL, PLY or OBJ"),
    "amf": ("an AMF file", "save it as STL, PLY or OBJ"),
    "svg": ("a drawing (SVG)", "export the surface itself, as STL or PLY"),
}
_START = 4096
_STL_HEADER = 84
_STL_FACE = 50
_NO_COUNT = (0, 0xFFFFFFFF)


def plain(content: bytes) -> bytes:
    """The content without the marks of Unicode at its start; UTF-16 becomes UTF-8."""
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return content.decode("utf-16", errors="replace").encode()
    return content.removeprefix(codecs.BOM_UTF8)


def is_text(content: bytes) -> bool:
    """Whether the start of the content is text: no zero bytes, few control characters."""
    start = content[:_START]
    odd = sum(byte < 9 or 13 < byte < 32 for byte in start)
    return odd == 0 or (0 not in start and odd < len(start) / 100)


def format_of(content: bytes, ending: str) -> str:
    """The mesh format of a content, a key of :data:`MESHES`; empty where it is none of them.

    Args:
        content: as :func:`plain` gives it.
        ending: of the file's name, without the dot; settles what has no mark of its own: binary STL and OBJ.
    """
    start = content[:_START].lstrip()
    if not content.strip(b"\0"):
        return ""
    if re.match(rb"ply\s", start):
        return "ply"
    if start.startswith(b"# vtk DataFile"):
        return "vtk"
    if start.startswith(b"glTF"):
        return "glb"
    if b"<VTKFile" in start:
        return "vtp"
    if re.match(rb"solid\b", start, re.IGNORECASE) and is_text(content) and _has_facets(content):
        return "stl"
    if _is_binary_stl(content, ending):
        return "stl"
    return "obj" if is_text(content) and _is_obj(content, ending) else ""


def _has_facets(content: bytes) -> bool:
    return re.search(rb"\b(facet|vertex|end\s*solid)\b", content[: 1 << 16], re.IGNORECASE) is not None


def _is_binary_stl(content: bytes, ending: str) -> bool:
    if len(content) < _STL_HEADER:
        return False
    (faces,) = struct.unpack_from("<I", content, 80)
    if faces not in _NO_COUNT and len(content) == _STL_HEADER + _STL_FACE * faces:
        return True
    return ending == "stl" and not is_text(content) and foreign(content) is None


def _is_obj(content: bytes, ending: str) -> bool:
    pattern = rb"^(v|f)[ \t]+\S+[ \t]+\S+[ \t]+\S+" if ending == "obj" else rb"^v[ \t]+\S+[ \t]+\S+[ \t]+\S+"
    return re.search(pattern, content[: 1 << 20], re.MULTILINE) is not None


def foreign(content: bytes) -> tuple[str, str] | None:
    """What a content, or its start, is that is no mesh, and what to do; None where that is not known."""
    start = content[:_START].lstrip()
    if content[:4] in (b"PK\x03\x04", b"PK\x05\x06"):
        is_3mf = b"3dmodel.model" in content or b"3D/" in content
        office = b"[Content_Types].xml" in content[:_START] and not is_3mf
        if is_3mf:
            return "a 3MF file", "save it as STL, PLY or OBJ"
        return ("an Office document" if office else "a zip archive"), "unpack it and give the file inside"
    for mark, what, remedy in _MAGIC:
        if content.startswith(mark):
            return what, remedy
    if is_tensors(content):
        return "an atlas or another .safetensors file", "name it so, and open it as an atlas if it is one"
    if content[344:348] in _NIFTI or content[4:8] == b"n+2\0":
        return "a NIfTI volume", "name it .nii"
    if content[128:132] == b"DICM":
        return "a DICOM image", "segment the scan and give the label volume or its surface"
    if content[257:262] == b"ustar":
        return "a tar archive", "unpack it and give the file inside"
    if start.startswith(b"{") and b'"asset"' in content:
        return "glTF as text", "save it as GLB"
    if start.startswith(b"<") and (name := _root(start)):
        return _ROOTS.get(name, (f"an XML file ('{name}')", "save the surface as STL, PLY or OBJ"))
    return None


def is_drawing(content: bytes) -> bool:
    """Whether it is a drawing (SVG)."""
    start = content[:_START].lstrip()
    return start.startswith(b"<") and _root(start).rsplit(":")[-1] == "svg"


def is_tensors(content: bytes) -> bool:
    """Whether it begins as safetensors do: with the length of a header in JSON, and that header."""
    length = int.from_bytes(content[:8], "little")
    return 2 <= length <= 100_000_000 and content[8:10] == b'{"'


def _root(markup: bytes) -> str:
    """The name of the outermost element."""
    while before := _BEFORE_ROOT.match(markup):
        markup = markup[before.end() :]
    root = _ROOT.match(markup)
    return "" if root is None else root[1].decode("ascii", "replace").casefold()


def refuse_foreign(name: str, content: bytes, known: str) -> InputError:
    """The error of a file that is no mesh: what it is, and what to do.

    Args:
        name: of the file.
        content: of the file.
        known: what could be read instead, as ``.stl, .ply``.
    """
    if content.startswith(b"\x1f\x8b") and (inner := _unpacked(content)) and (what := foreign(inner)):
        return InputError(f"{name} is {what[0]}, compressed with gzip; unpack it, then {what[1]}")
    if told := foreign(content):
        return InputError(f"{name} is {told[0]}; {told[1]}")
    if not content.strip(b"\0"):
        return InputError(f"{name} holds nothing but zeros, so it was not copied whole; copy it again")
    ending = Path(name).suffix.lower()
    if ending.removeprefix(".") not in MESHES:
        return InputError(f"{name} is not one of {known}; convert it first")
    shown = content[:40].decode("utf-8", "replace").split("\n")[0].strip()
    begins = (
        f"it begins with '{shown}'" if is_text(content) and shown else "its content is of no known format"
    )
    return InputError(f"{name} is no {MESHES[ending[1:]]} file ({begins}); export it again")


def _unpacked(content: bytes) -> bytes:
    """The start of what gzip packed; empty where that cannot be read."""
    try:
        return zlib.decompressobj(16 + zlib.MAX_WBITS).decompress(content, 1 << 16)
    except (zlib.error, EOFError, gzip.BadGzipFile):
        return b""
