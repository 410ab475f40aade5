"""Shapes whose volume is known in closed form, and files of them written byte by byte."""

from __future__ import annotations

import json
import struct

import numpy as np
import trimesh
from numpy.typing import ArrayLike, NDArray


def block(size_mm: ArrayLike = (40.0, 60.0, 100.0)) -> trimesh.Trimesh:
    """A box about the origin whose every side has 8 x 8 squares of two triangles."""
    mesh = trimesh.creation.box(size_mm)
    for _ in range(3):
        mesh = mesh.subdivide()
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)


def binary_stl(mesh: trimesh.Trimesh, count: int | None = None, header: bytes = b"") -> bytes:
    corners = np.zeros(len(mesh.faces), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
    corners["corners"] = mesh.triangles
    announced = len(mesh.faces) if count is None else count
    return header.ljust(80, b" ") + struct.pack("<I", announced) + corners.tobytes()


def text_stl(mesh: trimesh.Trimesh) -> str:
    lines = ["solid made by hand"]
    for triangle in mesh.triangles:
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += ["vertex {:.7g} {:.7g} {:.7g}".format(*corner) for corner in triangle]
        lines += ["endloop", "endfacet"]
    return "\n".join([*lines, "endsolid made by hand", ""])


def legacy_vtk(points: ArrayLike, cells: dict[str, list[list[int]]], binary: bool = False) -> bytes:
    """A legacy file of version 3, whose cells are written as their number of corners and the corners."""
    points = np.asarray(points, np.float64)
    parts = [
        f"# vtk DataFile Version 3.0\nby hand\n{'BINARY' if binary else 'ASCII'}\nDATASET POLYDATA\n".encode()
    ]
    parts += [f"POINTS {len(points)} double\n".encode(), _numbers(points, ">f8", binary)]
    for keyword, rows in cells.items():
        flat = np.array([number for row in rows for number in (len(row), *row)])
        parts += [f"{keyword} {len(rows)} {len(flat)}\n".encode(), _numbers(flat, ">i4", binary)]
    return b"".join(parts)


def _numbers(array: NDArray, kind: str, binary: bool) -> bytes:
    if binary:
        return array.astype(kind).tobytes() + b"\n"
    return " ".join(f"{number:.9g}" for number in array.ravel()).encode() + b"\n"


def glb(points_m: ArrayLike, indices: ArrayLike | None = None, mode: int = 4, **more: object) -> bytes:
    """A GLB with one primitive; ``more`` goes into its description."""
    points = np.asarray(points_m, "<f4")
    buffers = [points.tobytes()] + ([] if indices is None else [np.asarray(indices, "<u4").tobytes()])
    starts = np.cumsum([0, *map(len, buffers)]).tolist()
    bounds = {"min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()}
    accessors = [{"bufferView": 0, "componentType": 5126, "count": len(points), "type": "VEC3", **bounds}]
    primitive: dict[str, object] = {"attributes": {"POSITION": 0}, "mode": mode}
    if indices is not None:
        accessors.append(
            {"bufferView": 1, "componentType": 5125, "count": np.size(indices), "type": "SCALAR"}
        )
        primitive["indices"] = 1
    tree = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [primitive]}],
        "accessors": accessors,
        "bufferViews": [
            {"buffer": 0, "byteOffset": start, "byteLength": len(part)}
            for start, part in zip(starts, buffers, strict=False)
        ],
        "buffers": [{"byteLength": starts[-1]}],
        **more,
    }
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    body = b"".join(buffers)
    chunks = (
        struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(body), 0x004E4942) + body
    )
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks
