"""VTK's own formats: legacy files (``.vtk``), walked through here, and XML files (``.vtp``), read by VTK.

VTK's reader of legacy files fills in zeros where a text ends too early and says nothing, so every section's
length is compared with what the file announces before anything is made of it.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from naisr_model.data.readers.parts import (
    C_TYPES,
    NO_FACES,
    Parts,
    check_indices,
    cut_off,
    from_strips,
    numbers_of,
    silent_vtk,
    trailing,
    triangulated,
)
from naisr_model.errors import InputError

_TYPES = C_TYPES | {
    "unsigned_char": "u1",
    "unsigned_short": "u2",
    "unsigned_int": "u4",
    "long": "i8",
    "unsigned_long": "u8",
    "vtktypeint64": "i8",
    "vtktypeint32": "i4",
    "vtktypeuint64": "u8",
    "vtkidtype": "i4",
}
_CELLS = ("VERTICES", "LINES", "POLYGONS", "TRIANGLE_STRIPS", "CELLS")
_GRIDS = ("STRUCTURED_POINTS", "RECTILINEAR_GRID")
_GRID = "holds a grid of voxels; give a surface, or labels as NIfTI, NRRD or MetaImage"
_NEXT_WORD = re.compile(rb"\n[ \t]*[A-Za-z_]{3,}")


def read(name: str, content: bytes) -> Parts:
    """Read a legacy VTK file.

    Raises:
        InputError: when it is cut off, or holds no surface, lines or points.
    """
    kind = re.search(rb"^\s*DATASET\s+(\w+)", content, re.MULTILINE | re.IGNORECASE)
    head = content.split(b"\n", 4)
    if kind is None or len(head) < 4 or head[2].strip().upper() not in (b"ASCII", b"BINARY"):
        raise InputError(f"{name} is cut off or damaged: its header is not whole; copy or export it again")
    dataset = kind[1].decode().upper()
    if dataset in _GRIDS:
        raise InputError(f"{name} {_GRID}")
    legacy = _Legacy(name, content, head[2].strip().upper() == b"ASCII")
    points = legacy.points()
    cells = {key: found for key in _CELLS if (found := legacy.cells(key)) is not None}
    for _, corners in cells.values():
        check_indices(name, corners, len(points))
    if dataset != "POLYDATA":
        legacy.check_types()
        return _read_by_vtk(name, content, _legacy_reader())
    if not cells and len(points):
        remedy = "export it again, or save points as .xyz"
        raise InputError(
            f"{name} names {len(points):,} points and nothing made of them; it may be cut off: {remedy}"
        )
    faces = [_polygons(name, points, cells.get("POLYGONS")), _strips(cells.get("TRIANGLE_STRIPS"))]
    return Parts(points, np.concatenate(faces), len(cells["LINES"][0]) if "LINES" in cells else 0)


_Cells = tuple[NDArray[np.int64], NDArray[np.int64]]
"""Numbers of corners, and all corners in a row."""


def _polygons(name: str, points: NDArray[np.float64], cells: _Cells | None) -> NDArray[np.int64]:
    if cells is None:
        return NO_FACES
    counts, corners = cells
    kept = counts >= 3
    return triangulated(name, points, counts[kept], corners[np.repeat(kept, counts)])


def _strips(cells: _Cells | None) -> NDArray[np.int64]:
    return NO_FACES if cells is None else from_strips(np.split(cells[1], np.cumsum(cells[0])[:-1]))


class _Legacy:
    """The sections of a legacy file.

    Args:
        name: of the file, for errors.
        content: of the file.
        is_text: whether its numbers are.
    """

    def __init__(self, name: str, content: bytes, is_text: bool) -> None:
        self._name, self._content, self._is_text = name, content, is_text

    def points(self) -> NDArray[np.float64]:
        header = self._section(rb"POINTS\s+(\d+)\s+(\w+)")
        if header is None:
            return np.zeros((0, 3))
        count = int(header[1])
        kind = _TYPES.get(header[2].decode().lower(), "f4")
        numbers, _ = self._numbers(header.end(), 3 * count, kind, "coordinates")
        return numbers.astype(np.float64).reshape(-1, 3)

    def cells(self, keyword: str) -> _Cells | None:
        """Those of one kind; written as count and corners, or since version 5 as offsets and corners."""
        header = self._section(keyword.encode() + rb"\s+(\d+)\s+(\d+)")
        if header is None:
            return None
        first, second = int(header[1]), int(header[2])
        apart = re.compile(rb"\s*OFFSETS\s+(\w+)[ \t]*\r?\n", re.IGNORECASE).match(
            self._content, header.end()
        )
        if apart is None:
            flat, _ = self._numbers(header.end(), second, "i4", f"numbers of {keyword.lower()}")
            return _unpacked(self._name, flat.astype(np.int64), first)
        what = f"numbers of {keyword.lower()}"
        offsets, end = self._numbers(apart.end(), first, _TYPES.get(apart[1].decode().lower(), "i8"), what)
        pattern = re.compile(rb"\s*CONNECTIVITY\s+(\w+)[ \t]*\r?\n", re.IGNORECASE)
        joined = pattern.match(self._content, end)
        if joined is None:
            raise cut_off(self._name, what, first + second, first)
        kind = _TYPES.get(joined[1].decode().lower(), "i8")
        corners, _ = self._numbers(joined.end(), second, kind, what)
        starts = offsets.astype(np.int64)
        counts: NDArray[np.int64] = starts[1:] - starts[:-1]
        if (counts < 0).any() or counts.sum() != len(corners):
            raise InputError(f"{self._name} has {keyword.lower()} that do not add up; export it again")
        return counts, corners.astype(np.int64)

    def check_types(self) -> None:
        header = self._section(rb"CELL_TYPES\s+(\d+)")
        if header is not None:
            self._numbers(header.end(), int(header[1]), "i4", "cell types")
        elif self._section(rb"CELLS\s+(\d+)\s+(\d+)") is not None:
            raise InputError(
                f"{self._name} is cut off: it does not tell the types of its cells; copy it again"
            )

    def _section(self, pattern: bytes) -> re.Match[bytes] | None:
        return re.search(rb"(?:^|\n)[ \t]*" + pattern + rb"[ \t]*\r?(?:\n|$)", self._content, re.IGNORECASE)

    def _numbers(self, start: int, count: int, kind: str, what: str) -> tuple[NDArray[Any], int]:
        """``count`` numbers from ``start``, and where they end."""
        if self._is_text:
            stop = _NEXT_WORD.search(self._content, max(0, start - 1))
            end = stop.start() if stop else len(self._content)
            words = self._content[start:end].split()
            if len(words) < count:
                raise cut_off(self._name, what, count, len(words))
            try:
                return numbers_of(words[:count]), end
            except ValueError:
                raise InputError(f"{self._name} has {what} that are no numbers; export it again") from None
        number = np.dtype(f">{kind}")
        if start + count * number.itemsize > len(self._content):
            raise cut_off(self._name, what, count, max(0, len(self._content) - start) // number.itemsize)
        return np.frombuffer(self._content, number, count, start), start + count * number.itemsize


def _unpacked(name: str, flat: NDArray[np.int64], cells: int) -> _Cells:
    """Cells that are written as their number of corners and the corners, one after the other."""
    if cells and len(flat) % cells == 0:
        table = flat.reshape(cells, -1)
        if (table[:, 0] == table.shape[1] - 1).all():
            return table[:, 0], table[:, 1:].ravel()
    counts, corners, at = list[int](), list[NDArray[np.int64]](), 0
    while at < len(flat) and len(counts) < cells:
        counts.append(int(flat[at]))
        corners.append(flat[at + 1 : at + 1 + max(0, counts[-1])])
        at += 1 + max(0, counts[-1])
    if at != len(flat) or len(counts) != cells or min(counts, default=0) < 0:
        raise InputError(f"{name} has cells that do not add up; export it again")
    return np.array(counts, np.int64), np.concatenate([np.zeros(0, np.int64), *corners])


def read_xml(name: str, content: bytes) -> Parts:
    """Read an XML file of VTK's, whatever data set it holds.

    Raises:
        InputError: when it is cut off or damaged, or holds no surface, lines or points.
    """
    from vtkmodules.vtkIOXML import vtkXMLPolyDataReader, vtkXMLUnstructuredGridReader

    kind = re.search(rb"<VTKFile[^>]*\btype\s*=\s*[\"'](\w+)[\"']", content)
    dataset = "" if kind is None else kind[1].decode()
    readers = {"PolyData": vtkXMLPolyDataReader, "UnstructuredGrid": vtkXMLUnstructuredGridReader}
    if dataset in ("ImageData", "RectilinearGrid", "StructuredGrid"):
        raise InputError(f"{name} {_GRID}")
    if dataset not in readers:
        raise InputError(
            f"{name} is a VTK file of {dataset or 'an unknown kind'}; save the surface as VTP or STL"
        )
    end = content.rfind(_XML_END) + len(_XML_END)
    rest = len(content[end:].strip()) if end >= len(_XML_END) else 0
    content = content[:end] if rest else content
    reader = readers[dataset]()
    reader.ReadFromInputStringOn()
    reader.SetInputString(content)  # type: ignore[call-overload]  # bytes will do
    return _read_by_vtk(name, content, reader)._replace(remarks=trailing(rest))


_XML_END = b"</VTKFile>"


def _legacy_reader() -> Any:
    from vtkmodules.vtkIOLegacy import vtkGenericDataObjectReader

    return vtkGenericDataObjectReader()


def _read_by_vtk(name: str, content: bytes, reader: Any) -> Parts:
    import pyvista

    reader.ReadFromInputStringOn()
    if hasattr(reader, "SetBinaryInputString"):
        reader.SetBinaryInputString(content, len(content))
    with silent_vtk() as words:
        reader.Update()
        data = pyvista.wrap(reader.GetOutput())
        said = words.GetOutput()
    if said.strip():
        raise InputError(f"{name} is cut off or damaged ({_gist(said)}); copy or export it again")
    # Checked before the filters, which would read whatever lies beyond the points.
    check_indices(name, _point_indices(data), data.n_points)
    with silent_vtk():
        surface = (
            data if isinstance(data, pyvista.PolyData) else data.extract_surface(algorithm="dataset_surface")
        )
        triangles = surface.triangulate()
    points, faces = np.asarray(triangles.points, np.float64), np.asarray(triangles.regular_faces, np.int64)
    return Parts(points, faces.reshape(-1, 3), int(surface.n_lines))


def _gist(said: str) -> str:
    """The first thing that VTK said, without where in its source."""
    lines = [line.strip() for line in said.splitlines() if line.strip()]
    told = [
        line for line in lines if not line.startswith(("ERROR: In", "Warning: In", "Generic Warning: In"))
    ]
    return re.sub(r"^\w+ \(0x[0-9a-f]+\): ", "", (told or lines)[0])[:120].rstrip(".")


def _point_indices(data: Any) -> NDArray[np.int64]:
    """Every point that a cell of the data set names; none for a grid, whose cells are implied."""
    import pyvista

    getters = (getattr(data, f"Get{kind}", None) for kind in ("Verts", "Lines", "Polys", "Strips", "Cells"))
    arrays = [pyvista.convert_array(get().GetConnectivityArray()) for get in getters if get is not None]
    return np.concatenate([np.zeros(0, np.int64), *arrays])
