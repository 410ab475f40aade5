"""GLB, the binary form of glTF 2.0: metres, y up, as the format says."""

from __future__ import annotations

import io
import json
import struct
from collections import Counter
from typing import Any

import numpy as np
import trimesh

from naisr_model.data.readers.parts import NO_FACES, Parts, cut_off, trailing
from naisr_model.errors import InputError

_COMPRESSIONS = {"KHR_draco_mesh_compression": "Draco", "EXT_meshopt_compression": "meshopt"}
_HARMLESS = ("KHR_materials", "KHR_texture", "KHR_lights", "EXT_texture", "KHR_xmp")
_POINTS, _TRIANGLES, _STRIP, _FAN = 0, 4, 5, 6
_LINES = (1, 2, 3)


def read(name: str, content: bytes) -> Parts:
    """Read a GLB file; coordinates as in the file.

    Raises:
        InputError: when it is cut off, compressed, or uses what is not read.
    """
    tree = _tree(name, content)
    _refuse_extensions(name, tree)
    modes = _modes(tree)
    lines = sum(modes[mode] for mode in _LINES)
    if modes[_FAN] or ((modes[2] or modes[3]) and (modes[_TRIANGLES] or modes[_STRIP])):
        raise InputError(
            f"{name} holds fans of triangles, or strips of lines beside a surface; export triangles alone"
        )
    if not modes[_TRIANGLES] and not modes[_STRIP] and lines:
        return Parts(np.zeros((1, 3)), NO_FACES, lines)
    if not modes.total() or not tree.get("scenes") or not tree.get("nodes"):
        raise InputError(f"{name} holds no scene with a surface in it; export the surface again")
    (length,) = struct.unpack_from("<I", content, 8)
    scene = trimesh.load_scene(io.BytesIO(content[:length]), file_type="glb", process=False)
    dumped = scene.dump()
    surfaces = [part for part in dumped if isinstance(part, trimesh.Trimesh)]
    clouds = [part for part in dumped if isinstance(part, trimesh.PointCloud)]
    if not surfaces:
        vertices = (np.asarray(cloud.vertices, np.float64) for cloud in clouds)
        return Parts(np.concatenate([np.zeros((0, 3)), *vertices]))
    starts = np.cumsum([0, *(len(part.vertices) for part in surfaces)])
    points = np.concatenate([np.asarray(part.vertices, np.float64) for part in surfaces])
    faces = [np.asarray(part.faces, np.int64) + start for part, start in zip(surfaces, starts, strict=False)]
    return Parts(points, np.concatenate(faces), lines, trailing(len(content) - length))


def _tree(name: str, content: bytes) -> dict[str, Any]:
    """The file's description of itself, its first chunk."""
    if len(content) < 20:
        raise cut_off(name, "bytes", 20, len(content))
    version, length, size, kind = struct.unpack_from("<IIII", content, 4)
    if version != 2:
        raise InputError(f"{name} is GLB of version {version}; export it as glTF 2.0")
    if length > len(content):
        raise cut_off(name, "bytes", length, len(content))
    try:
        tree = json.loads(content[20 : 20 + size]) if kind == 0x4E4F534A else None
    except ValueError:
        tree = None
    if not isinstance(tree, dict):
        raise InputError(f"{name} is damaged: its description cannot be read; copy or export it again")
    return tree


def _refuse_extensions(name: str, tree: dict[str, Any]) -> None:
    required = [str(extension) for extension in tree.get("extensionsRequired", [])]
    used = {*required, *(str(extension) for extension in tree.get("extensionsUsed", []))}
    for extension, called in _COMPRESSIONS.items():
        if extension in used:
            raise InputError(f"{name} is compressed with {called}; export it without compression")
    for extension in required:
        if not extension.startswith(_HARMLESS):
            raise InputError(
                f"{name} needs the glTF extension {extension}, which is not read; export it without"
            )


def _modes(tree: dict[str, Any]) -> Counter[int]:
    """How often each kind of primitive occurs."""
    primitives = (each for mesh in tree.get("meshes", []) for each in mesh.get("primitives", []))
    return Counter(int(each.get("mode", _TRIANGLES)) for each in primitives)
