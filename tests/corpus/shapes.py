"""The good shape, an egg, as every kind of mesh file that people bring; written here and not by a library."""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from eggs import egg
from numpy.typing import ArrayLike, NDArray

Points = NDArray[np.float64]
Polygons = Sequence[Sequence[int]]


@dataclass(frozen=True, eq=False)
class Shape:
    """Points in millimetres and the polygons between them."""

    points: Points
    polygons: Polygons

    def moved(self, matrix: ArrayLike, shift: ArrayLike = (0.0, 0.0, 0.0)) -> Shape:
        """Points times a 3x3 matrix, or a number, and shifted."""
        factor = np.asarray(matrix, float) * np.eye(3) if np.ndim(matrix) == 0 else np.asarray(matrix, float)
        return Shape(self.points @ factor.T + np.asarray(shift, float), self.polygons)

    def turned_round(self, which: slice = slice(None)) -> Shape:
        """Some polygons run through the other way."""
        polygons = [list(each) for each in self.polygons]
        polygons[which] = [each[::-1] for each in polygons[which]]
        return Shape(self.points, polygons)

    def __add__(self, other: Shape) -> Shape:
        offset = len(self.points)
        moved = [[index + offset for index in polygon] for polygon in other.polygons]
        return Shape(np.concatenate([self.points, other.points]), [*self.polygons, *moved])

    @property
    def triangles(self) -> NDArray[np.int64]:
        """Fans over the polygons, ``[n, 3]``."""
        fans = [(p[0], p[i], p[i + 1]) for p in self.polygons for i in range(1, len(p) - 1)]
        return np.array(fans, np.int64).reshape(-1, 3)

    @property
    def volume_cm3(self) -> float:
        """By the divergence theorem."""
        a, b, c = self.points[self.triangles].transpose(1, 0, 2)
        return float(np.einsum("ij,ij", a, np.cross(b, c))) / 6000


@cache
def triangles() -> Shape:
    """An egg of triangles: a boy's of 6 years."""
    mesh = egg(6.0, 1.0)
    return Shape(np.asarray(mesh.vertices, float), np.asarray(mesh.faces).tolist())


@cache
def quads(rings: int = 24, sides: int = 32) -> Shape:
    """Nearly the same egg as a globe: quads, and triangles about the poles."""
    half = np.abs(egg(6.0, 1.0).bounds[0])
    polar = np.pi * np.arange(1, rings) / rings
    around = 2 * np.pi * np.arange(sides) / sides
    u, v = np.meshgrid(polar, around, indexing="ij")
    belt = np.stack([np.sin(u) * np.cos(v), np.sin(u) * np.sin(v), np.cos(u)], axis=-1).reshape(-1, 3)
    points = np.concatenate([belt, [[0, 0, 1], [0, 0, -1]]]) * half
    north, south = len(belt), len(belt) + 1
    polygons: list[list[int]] = []
    for j in range(sides):
        k, last = (j + 1) % sides, (rings - 2) * sides
        polygons += [[north, j, k], [south, last + k, last + j]]
        for i in range(rings - 2):
            polygons.append([i * sides + j, (i + 1) * sides + j, (i + 1) * sides + k, i * sides + k])
    return Shape(points, polygons)


def strips(rings: int = 24, sides: int = 32) -> tuple[Shape, list[list[int]]]:
    """The globe, and each of its belts as one strip of triangles; the poles as strips of one triangle."""
    shape = quads(rings, sides)
    belts = [
        [index for j in range(sides + 1) for index in (i * sides + j % sides, (i + 1) * sides + j % sides)]
        for i in range(rings - 2)
    ]
    return shape, [list(polygon) for polygon in shape.polygons if len(polygon) == 3] + belts


# --- STL ----------------------------------------------------------------------------------------


def stl(shape: Shape, header: bytes = b"made by hand", count: int | None = None, order: str = "<") -> bytes:
    """Binary; ``count`` is what is announced where that is not the truth."""
    corners = shape.points[shape.triangles].astype(f"{order}f4")
    record = np.zeros(
        len(corners), [("normal", f"{order}f4", 3), ("corners", f"{order}f4", (3, 3)), ("a", "u2")]
    )
    record["corners"] = corners
    return (
        header.ljust(80, b"\0")
        + struct.pack(f"{order}I", len(corners) if count is None else count)
        + record.tobytes()
    )


def stl_text(shape: Shape, number: str = "{:.6e}", name: str = "egg") -> bytes:
    """ASCII."""
    lines = [f"solid {name}"]
    for corners in shape.points[shape.triangles]:
        lines += [" facet normal 0 0 0", "  outer loop"]
        lines += ["   vertex " + " ".join(number.format(x) for x in corner) for corner in corners]
        lines += ["  endloop", " endfacet"]
    return "\n".join([*lines, f"endsolid {name}", ""]).encode()


# --- PLY ----------------------------------------------------------------------------------------


def ply(
    shape: Shape,
    order: str = "<",
    real: str = "float",
    index: str = "int",
    before: Sequence[str] = (),
    property_name: str = "vertex_indices",
) -> bytes:
    """Binary; ``order`` is < or >."""
    name = {"<": "binary_little_endian", ">": "binary_big_endian"}[order]
    header = _ply_header(name, shape, real, index, before, property_name)
    points = shape.points.astype(order + {"float": "f4", "double": "f8"}[real]).tobytes()
    code = {"int": "i", "uint": "I", "ushort": "H"}[index]
    faces = b"".join(struct.pack(f"{order}B{len(p)}{code}", len(p), *p) for p in shape.polygons)
    return header + points + faces


def ply_text(shape: Shape, before: Sequence[str] = ()) -> bytes:
    """ASCII."""
    points = [" ".join(f"{x:.6f}" for x in point) for point in shape.points]
    faces = [" ".join(map(str, [len(p), *p])) for p in shape.polygons]
    return _ply_header("ascii", shape, "float", "int", before) + "\n".join([*points, *faces, ""]).encode()


def _ply_header(
    name: str, shape: Shape, real: str, index: str, before: Sequence[str], listed: str = "vertex_indices"
) -> bytes:
    lines = ["ply", f"format {name} 1.0", *before, f"element vertex {len(shape.points)}"]
    lines += [f"property {real} {axis}" for axis in "xyz"]
    lines += [
        f"element face {len(shape.polygons)}",
        f"property list uchar {index} {listed}",
        "end_header",
        "",
    ]
    return "\n".join(lines).encode()


def ply_records(shape: Shape, extra: str, vertex: bytes, face: str, each: bytes) -> bytes:
    """Binary with more properties: declarations and the bytes that each vertex and each face then has."""
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(shape.points)}"]
    lines += [f"property float {axis}" for axis in "xyz"] + [line for line in extra.split(";") if line]
    lines += [f"element face {len(shape.polygons)}", "property list uchar int vertex_indices"]
    lines += [line for line in face.split(";") if line] + ["end_header", ""]
    points = b"".join(point.astype("<f4").tobytes() + vertex for point in shape.points)
    faces = b"".join(struct.pack(f"<B{len(p)}i", len(p), *p) + each for p in shape.polygons)
    return "\n".join(lines).encode() + points + faces


def ply_strips() -> bytes:
    """Binary, with one long list of strips that are parted by -1."""
    shape, runs = strips()
    flat = [index for run in runs for index in (*run, -1)]
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(shape.points)}"]
    lines += [f"property float {axis}" for axis in "xyz"]
    lines += ["element tristrips 1", "property list int int vertex_indices", "end_header", ""]
    body = struct.pack(f"<i{len(flat)}i", len(flat), *flat)
    return "\n".join(lines).encode() + shape.points.astype("<f4").tobytes() + body


# --- OBJ ----------------------------------------------------------------------------------------


def obj(shape: Shape, corner: str = "{0}", head: str = "", vertex: str = "v {:.6f} {:.6f} {:.6f}") -> bytes:
    """``corner`` is how a face names a vertex, by its number from 1 and its number from the end."""
    total = len(shape.points)
    points = [vertex.format(*point) for point in shape.points]
    faces = [
        "f " + " ".join(corner.format(index + 1, index - total) for index in polygon)
        for polygon in shape.polygons
    ]
    return "\n".join([*head.splitlines(), *points, *faces, ""]).encode()


# --- VTK ----------------------------------------------------------------------------------------


def vtk_text(shape: Shape, title: str = "egg", kind: str = "POLYDATA") -> bytes:
    """Legacy, ASCII."""
    count, size = len(shape.polygons), sum(len(p) + 1 for p in shape.polygons)
    grid = kind == "UNSTRUCTURED_GRID"
    types = [f"CELL_TYPES {count}", *("5" if len(p) == 3 else "9" for p in shape.polygons)] if grid else []
    lines = ["# vtk DataFile Version 3.0", title, "ASCII", f"DATASET {kind}"]
    lines += [f"POINTS {len(shape.points)} float", *(" ".join(f"{x:.6f}" for x in p) for p in shape.points)]
    lines += [f"{'CELLS' if grid else 'POLYGONS'} {count} {size}"]
    lines += [" ".join(map(str, [len(p), *p])) for p in shape.polygons]
    return "\n".join([*lines, *types, ""]).encode()


def vtk(shape: Shape) -> bytes:
    """Legacy, binary."""
    count, size = len(shape.polygons), sum(len(p) + 1 for p in shape.polygons)
    head = f"# vtk DataFile Version 3.0\negg\nBINARY\nDATASET POLYDATA\nPOINTS {len(shape.points)} float\n"
    cells = b"".join(struct.pack(f">{len(p) + 1}i", len(p), *p) for p in shape.polygons)
    points = shape.points.astype(">f4").tobytes()
    return head.encode() + points + f"\nPOLYGONS {count} {size}\n".encode() + cells + b"\n"


def vtk_strips() -> bytes:
    """Legacy, ASCII, as strips of triangles."""
    shape, runs = strips()
    lines = [
        "# vtk DataFile Version 3.0",
        "egg",
        "ASCII",
        "DATASET POLYDATA",
        f"POINTS {len(shape.points)} float",
    ]
    lines += [" ".join(f"{x:.6f}" for x in point) for point in shape.points]
    lines += [f"TRIANGLE_STRIPS {len(runs)} {sum(len(run) + 1 for run in runs)}"]
    return "\n".join([*lines, *(" ".join(map(str, [len(run), *run])) for run in runs), ""]).encode()


def vtp(shape: Shape, mode: str = "Appended", *, packed: bool = True, lines: bool = False) -> bytes:
    """XML as VTK writes it: Ascii, Binary or Appended, packed by zlib or not; as lines instead of faces."""
    import pyvista
    from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter

    cells = np.concatenate([[len(p), *p] for p in shape.polygons]).astype(np.int64)
    data = pyvista.PolyData(shape.points, **{"lines" if lines else "faces": cells})
    writer = vtkXMLPolyDataWriter()
    writer.SetInputData(data)
    getattr(writer, f"SetDataModeTo{mode}")()
    if not packed:
        writer.SetCompressorTypeToNone()
    writer.WriteToOutputStringOn()
    writer.Write()
    text: str | bytes = writer.GetOutputString()
    return text.encode("latin-1") if isinstance(text, str) else text


# --- GLB ----------------------------------------------------------------------------------------

UPRIGHT_M = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]) / 1000
"""Millimetres with z up to metres with y up, as the format wants them."""


def glb(shape: Shape, mode: int = 4, change: dict[str, object] | None = None, factor: float = 1.0) -> bytes:
    """One mesh in metres with y up; ``mode`` 4 is triangles, 1 lines, 0 points; more keys of its JSON."""
    points = (factor * shape.points @ UPRIGHT_M.T).astype("<f4")
    indices = shape.triangles.astype("<u4")
    body = points.tobytes() + indices.tobytes()
    record: dict[str, object] = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "mode": mode}]}],
        "buffers": [{"byteLength": len(body)}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": points.nbytes},
            {"buffer": 0, "byteOffset": points.nbytes, "byteLength": indices.nbytes},
        ],
        "accessors": [
            {
                "bufferView": 0,
                "componentType": 5126,
                "count": len(points),
                "type": "VEC3",
                "min": points.min(axis=0).tolist(),
                "max": points.max(axis=0).tolist(),
            },
            {"bufferView": 1, "componentType": 5125, "count": indices.size, "type": "SCALAR"},
        ],
    }
    return glb_of(record | (change or {}), body)


def glb_of(record: dict[str, object], body: bytes) -> bytes:
    """The two chunks of a file: what is in it, and the numbers."""
    text = json.dumps(record).encode()
    text, body = text.ljust(-(-len(text) // 4) * 4), body.ljust(-(-len(body) // 4) * 4, b"\0")
    chunks = (
        struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(body), 0x004E4942) + body
    )
    return struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks
