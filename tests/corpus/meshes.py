"""Surfaces as every tool writes them, and broken ones."""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from functools import partial

import numpy as np
from corpus import damage, shapes
from corpus.case import REFUSED, Case, Damage, Ending, Expected, Special
from corpus.fits import case, part, special, whole
from corpus.shapes import Shape, quads, triangles
from numpy.typing import ArrayLike

KIND = "mesh"
_mesh = partial(case, KIND)

EGG = triangles().volume_cm3
GLOBE = quads().volume_cm3

BINARY: Mapping[str, Callable[[], bytes]] = {
    "stl": lambda: shapes.stl(triangles()),
    "ply": lambda: shapes.ply(triangles()),
    "vtk": lambda: shapes.vtk(triangles()),
    "vtp": lambda: shapes.vtp(triangles(), packed=False),
    "glb": lambda: shapes.glb(triangles()),
}
TEXT: Mapping[str, Callable[[], bytes]] = {
    "stl": lambda: shapes.stl_text(triangles()),
    "ply": lambda: shapes.ply_text(triangles()),
    "obj": lambda: shapes.obj(triangles()),
    "vtk": lambda: shapes.vtk_text(triangles()),
    "vtp": lambda: shapes.vtp(triangles(), "Ascii"),
}


def _good(name: str, file: str, good: Callable[[], bytes], *damages: Damage, truth: float = EGG) -> Case:
    return _mesh(name, file, good, whole(truth), *damages)


_WRITTEN = [
    *(_good(f"binary {ending}", f"egg.{ending}", good) for ending, good in BINARY.items()),
    *(_good(f"text {ending}", f"egg.{ending}", good) for ending, good in TEXT.items()),
    *(_good(f"capital .{ending.upper()}", f"EGG.{ending.upper()}", good) for ending, good in BINARY.items()),
    *(
        _good(f"{true} named .{name}", f"egg.{name}", BINARY[true])
        for true, name in (
            *(("stl", "ply"), ("stl", "obj"), ("stl", "vtk"), ("ply", "stl"), ("ply", "vtp"), ("vtk", "stl")),
            *(("vtk", "vtp"), ("vtp", "vtk"), ("glb", "stl"), ("stl", "glb")),
        )
    ),
    *(
        _good(f"text {true} named .{name}", f"egg.{name}", TEXT[true])
        for true, name in (("stl", "obj"), ("obj", "stl"), ("ply", "stl"), ("vtk", "ply"), ("vtp", "obj"))
    ),
    *(
        _mesh(f"{true} named {name}", name, BINARY[true], whole(EGG, "either"))
        for true, name in (("stl", "egg"), ("ply", "egg.dat"), ("stl", "egg.stl.part"), ("vtk", "egg.nii"))
    ),
    _mesh("gzipped stl", "egg.stl", BINARY["stl"], whole(EGG, "either"), damage.gzipped),
    _mesh("gzipped ply", "egg.ply.gz", BINARY["ply"], whole(EGG, "either"), damage.gzipped),
]
_STL = [
    *(
        _good(f"stl: {count} announced", "egg.stl", partial(shapes.stl, triangles(), count=count))
        for count in (0, 0xFFFFFFFF)
    ),
    *(
        _mesh(f"stl: {count} announced", "egg.stl", partial(shapes.stl, triangles(), count=count), REFUSED)
        for count in (1281, 4_000_000)
    ),
    _mesh("stl: fewer announced", "egg.stl", partial(shapes.stl, triangles(), count=1000), part("either")),
    _good("stl: a header of an ASCII file", "egg.stl", partial(shapes.stl, triangles(), b"solid egg")),
    _good("stl: a header of bytes", "egg.stl", partial(shapes.stl, triangles(), bytes(range(128, 208)))),
    _mesh("stl: the other byte order", "egg.stl", partial(shapes.stl, triangles(), order=">"), REFUSED),
    *(
        _good(f"stl: {len(more)} bytes more", "egg.stl", BINARY["stl"], damage.ended_with(more))
        for more in (b"\n", b"\0" * 7, b"made by a tool\r\n" * 5)
    ),
    _good("stl: twice", "egg.stl", BINARY["stl"], damage.doubled),
    _good("ASCII stl: twice", "egg.stl", TEXT["stl"], damage.doubled),
    _good("ASCII stl: end loop", "egg.stl", TEXT["stl"], damage.replaced(b"endloop", b"end loop")),
    _good("ASCII stl: end facet", "egg.stl", TEXT["stl"], damage.replaced(b"endfacet", b"end facet")),
    _good("ASCII stl: capitals", "egg.stl", lambda: TEXT["stl"]().upper()),
    _good("ASCII stl: a mark", "egg.stl", TEXT["stl"], damage.begun_with(b"\xef\xbb\xbf")),
    _good("ASCII stl: empty lines first", "egg.stl", TEXT["stl"], damage.begun_with(b"\n\n")),
    _good("ASCII stl: no endsolid", "egg.stl", TEXT["stl"], damage.replaced(b"endsolid egg\n", b"")),
    _good("ASCII stl: lines of Windows", "egg.stl", TEXT["stl"], damage.replaced(b"\n", b"\r\n")),
    _good("ASCII stl: tabs", "egg.stl", TEXT["stl"], damage.replaced(b" ", b"\t")),
    _mesh(
        "ASCII stl: one long line", "egg.stl", TEXT["stl"], whole(EGG, "either"), damage.replaced(b"\n", b" ")
    ),
    _good("ASCII stl: no name", "egg.stl", partial(shapes.stl_text, triangles(), name="")),
    _good(
        "ASCII stl: a name in Latin-1",
        "egg.stl",
        lambda: shapes.stl_text(triangles(), name="Röhre").decode().encode("latin-1"),
    ),
    _good(
        "ASCII stl: a name with words",
        "egg.stl",
        partial(shapes.stl_text, triangles(), name="facet of an egg"),
    ),
    _good("ASCII stl: exponents in capitals", "egg.stl", partial(shapes.stl_text, triangles(), "{:+.6E}")),
    _good("ASCII stl: numbers in full", "egg.stl", partial(shapes.stl_text, triangles(), "{:.12f}")),
    _mesh(
        "ASCII stl: decimal commas", "egg.stl", TEXT["stl"], whole(EGG, "either"), damage.replaced(b".", b",")
    ),
    _mesh("ASCII stl: UTF-16", "egg.stl", TEXT["stl"], whole(EGG, "either"), damage.encoded("utf-16")),
    _good("ASCII stl: something after it", "egg.stl", TEXT["stl"], damage.ended_with(b"\n\x1a\n")),
    _mesh(
        "ASCII stl: nan",
        "egg.stl",
        TEXT["stl"],
        REFUSED,
        damage.replaced(b"vertex 0.000000e+00", b"vertex nan", 9),
    ),
    _mesh("ASCII stl: a vertex too few", "egg.stl", TEXT["stl"], REFUSED, damage.replaced(b"vertex", b"", 1)),
    _mesh(
        "ASCII stl: a number too few",
        "egg.stl",
        TEXT["stl"],
        REFUSED,
        damage.replaced(b"vertex 0.000000e+00", b"vertex", 1),
    ),
    _mesh(
        "ASCII stl: a word for a number",
        "egg.stl",
        TEXT["stl"],
        REFUSED,
        damage.replaced(b"0.000000e+00", b"zero", 1),
    ),
]
_COLOURS = ";".join(f"property uchar {name}" for name in ("red", "green", "blue", "alpha"))
_NORMALS = ";".join(f"property double {name}" for name in ("nx", "ny", "nz"))
_PLY = [
    _good("ply: doubles", "egg.ply", partial(shapes.ply, triangles(), real="double")),
    _good("ply: big endian", "egg.ply", partial(shapes.ply, triangles(), ">")),
    _good("ply: big endian doubles", "egg.ply", partial(shapes.ply, triangles(), ">", "double", "uint")),
    _good("ply: unsigned indices", "egg.ply", partial(shapes.ply, triangles(), index="uint")),
    _good("ply: short indices", "egg.ply", partial(shapes.ply, triangles(), index="ushort")),
    _good("ply: vertex_index", "egg.ply", partial(shapes.ply, triangles(), property_name="vertex_index")),
    _good(
        "ply: remarks",
        "egg.ply",
        partial(shapes.ply, triangles(), before=("comment by hand", "obj_info a b")),
    ),
    _good(
        "ply: lines of Windows in the header",
        "egg.ply",
        lambda: shapes.ply(triangles()).replace(b"\n", b"\r\n", 9),
    ),
    _good(
        "ply: colours",
        "egg.ply",
        partial(shapes.ply_records, triangles(), _COLOURS, b"\x80\x80\x80\xff", "", b""),
    ),
    _good("ply: normals", "egg.ply", partial(shapes.ply_records, triangles(), _NORMALS, bytes(24), "", b"")),
    _good(
        "ply: colours of faces",
        "egg.ply",
        partial(shapes.ply_records, triangles(), "", b"", _COLOURS, b"\1\2\3\4"),
    ),
    _good(
        "ply: texture coordinates",
        "egg.ply",
        partial(
            shapes.ply_records, triangles(), "", b"", "property list uchar float texcoord", b"\6" + bytes(24)
        ),
    ),
    _good("ply: quads and triangles", "egg.ply", partial(shapes.ply, quads()), truth=GLOBE),
    _good("ply: quads and triangles, big endian", "egg.ply", partial(shapes.ply, quads(), ">"), truth=GLOBE),
    _good("text ply: quads and triangles", "egg.ply", partial(shapes.ply_text, quads()), truth=GLOBE),
    _good("ply: strips of triangles", "egg.ply", shapes.ply_strips, truth=GLOBE),
    _good("ply: 9 bytes more", "egg.ply", BINARY["ply"], damage.ended_with(bytes(9))),
    _good("text ply: lines more", "egg.ply", TEXT["ply"], damage.ended_with(b"\n\n")),
    _good("text ply: lines of Windows", "egg.ply", TEXT["ply"], damage.replaced(b"\n", b"\r\n")),
    _mesh("ply: twice", "egg.ply", BINARY["ply"], whole(EGG, "either"), damage.doubled),
    _mesh(
        "text ply: decimal commas", "egg.ply", TEXT["ply"], whole(EGG, "either"), damage.replaced(b".", b",")
    ),
    _mesh("ply: the other byte order", "egg.ply", BINARY["ply"], REFUSED, damage.replaced(b"little", b"big")),
    _mesh(
        "ply: text that is none",
        "egg.ply",
        BINARY["ply"],
        REFUSED,
        damage.replaced(b"binary_little_endian", b"ascii"),
    ),
    _mesh(
        "ply: binary that is none",
        "egg.ply",
        TEXT["ply"],
        REFUSED,
        damage.replaced(b"ascii", b"binary_little_endian"),
    ),
    _mesh("ply: no x", "egg.ply", BINARY["ply"], REFUSED, damage.replaced(b"float x", b"float u")),
    _mesh(
        "ply: no end of the header", "egg.ply", BINARY["ply"], REFUSED, damage.replaced(b"end_header", b"")
    ),
    *(
        _mesh(
            f"ply: {claim} announced",
            "egg.ply",
            BINARY["ply"],
            REFUSED,
            damage.replaced(true, claim.encode()),
        )
        for true, claim in (
            *((b"face 1280", "face 1281"), (b"face 1280", "face 99999999999"), (b"face 1280", "face -1")),
            *(
                (b"vertex 642", "vertex 650"),
                (b"vertex 642", "vertex 4000000000"),
                (b"vertex 642", "vertex x"),
            ),
        )
    ),
]
_TEXTURED = "mtllib nowhere.mtl\no egg\nusemtl shell\ns off\n# by hand\nvt 0 0\nvn 0 0 1\n"
_OBJ = [
    _good("obj: v/vt/vn", "egg.obj", partial(shapes.obj, triangles(), "{0}/1/1", _TEXTURED)),
    _good("obj: v//vn", "egg.obj", partial(shapes.obj, triangles(), "{0}//1", _TEXTURED)),
    _good("obj: v/vt", "egg.obj", partial(shapes.obj, triangles(), "{0}/1", _TEXTURED)),
    _good("obj: counted from the end", "egg.obj", partial(shapes.obj, triangles(), "{1}")),
    _good("obj: quads", "egg.obj", partial(shapes.obj, quads()), truth=GLOBE),
    _good(
        "obj: colours",
        "egg.obj",
        partial(shapes.obj, triangles(), vertex="v {:.6f} {:.6f} {:.6f} 0.5 0.5 0.5"),
    ),
    _good("obj: weights", "egg.obj", partial(shapes.obj, triangles(), vertex="v {:.6f} {:.6f} {:.6f} 1.0")),
    _good("obj: groups", "egg.obj", TEXT["obj"], damage.replaced(b"\nf 1 ", b"\ng side\nusemtl a\nf 1 ")),
    _good("obj: lines of Windows", "egg.obj", TEXT["obj"], damage.replaced(b"\n", b"\r\n")),
    _good("obj: tabs", "egg.obj", TEXT["obj"], damage.replaced(b" ", b"\t")),
    _good("obj: a mark", "egg.obj", TEXT["obj"], damage.begun_with(b"\xef\xbb\xbf# by hand\n")),
    _good("obj: a remark in Latin-1", "egg.obj", TEXT["obj"], damage.begun_with(b"# R\xf6hre\n")),
    _good("obj: twice", "egg.obj", TEXT["obj"], damage.doubled),
    _good("obj: lines go on", "egg.obj", TEXT["obj"], damage.replaced(b"f 1 ", b"f 1 \\\n")),
    _mesh("obj: UTF-16", "egg.obj", TEXT["obj"], whole(EGG, "either"), damage.encoded("utf-16")),
    _mesh("obj: decimal commas", "egg.obj", TEXT["obj"], whole(EGG, "either"), damage.replaced(b".", b",")),
    _mesh(
        "obj: a vertex that is not there",
        "egg.obj",
        TEXT["obj"],
        REFUSED,
        damage.ended_with(b"f 1 2 99999\n"),
    ),
    _mesh("obj: vertex 0", "egg.obj", TEXT["obj"], REFUSED, damage.ended_with(b"f 0 1 2\n")),
    _mesh("obj: a word for a number", "egg.obj", TEXT["obj"], REFUSED, damage.begun_with(b"v a b c\n")),
    _mesh("obj: nan", "egg.obj", TEXT["obj"], REFUSED, damage.begun_with(b"v nan nan nan\nf 1 2 3\n")),
    _mesh("obj: lines alone", "egg.obj", TEXT["obj"], REFUSED, damage.replaced(b"\nf ", b"\nl ")),
]
_VTK = [
    _good("vtk: strips", "egg.vtk", shapes.vtk_strips, truth=GLOBE),
    _good("vtk: quads", "egg.vtk", partial(shapes.vtk, quads()), truth=GLOBE),
    _good(
        "vtk: unstructured",
        "egg.vtk",
        partial(shapes.vtk_text, quads(), kind="UNSTRUCTURED_GRID"),
        truth=GLOBE,
    ),
    _good("vtk: a long title", "egg.vtk", partial(shapes.vtk_text, triangles(), "an egg " * 35)),
    _good("vtk: lines of Windows", "egg.vtk", TEXT["vtk"], damage.replaced(b"\n", b"\r\n")),
    _good("vtk: small letters", "egg.vtk", TEXT["vtk"], damage.replaced(b"POLYGONS", b"polygons")),
    _good(
        "vtk: RAS in the title",
        "egg.vtk",
        partial(shapes.vtk_text, triangles(), "3D Slicer output. SPACE=RAS"),
    ),
    _good("vtk: text behind", "egg.vtk", TEXT["vtk"], damage.ended_with(b"\n\n")),
    _mesh("vtk: twice", "egg.vtk", BINARY["vtk"], whole(EGG, "either"), damage.doubled),
    _mesh("vtk: decimal commas", "egg.vtk", TEXT["vtk"], REFUSED, damage.replaced(b".", b",")),
    _mesh("vtk: text that is none", "egg.vtk", BINARY["vtk"], REFUSED, damage.replaced(b"BINARY", b"ASCII")),
    _mesh("vtk: binary that is none", "egg.vtk", TEXT["vtk"], REFUSED, damage.replaced(b"ASCII", b"BINARY")),
    _mesh(
        "vtk: an unknown data set", "egg.vtk", TEXT["vtk"], REFUSED, damage.replaced(b"POLYDATA", b"OCTREE")
    ),
    *(
        _mesh(f"{ending}: {claim} announced", "egg.vtk", good, REFUSED, damage.replaced(true, claim.encode()))
        for ending, good in (("vtk", BINARY["vtk"]), ("text vtk", TEXT["vtk"]))
        for true, claim in (
            *((b"POLYGONS 1280 5120", "POLYGONS 1290 5160"), (b"POLYGONS 1280 5120", "POLYGONS -1 -4")),
            *(
                (b"POINTS 642", "POINTS 650"),
                (b"POINTS 642", "POINTS 2000000000"),
                (b"POINTS 642", "POINTS 600"),
            ),
        )
    ),
    _good("vtp: text", "egg.vtp", partial(shapes.vtp, triangles(), "Ascii")),
    _good("vtp: base64", "egg.vtp", partial(shapes.vtp, triangles(), "Binary", packed=False)),
    _good("vtp: packed base64", "egg.vtp", partial(shapes.vtp, triangles(), "Binary")),
    _good("vtp: packed", "egg.vtp", partial(shapes.vtp, triangles())),
    _good("vtp: quads", "egg.vtp", partial(shapes.vtp, quads()), truth=GLOBE),
    _good("vtp: a line more", "egg.vtp", BINARY["vtp"], damage.ended_with(b"\n")),
    _mesh("vtp: lines", "egg.vtp", partial(shapes.vtp, triangles(), lines=True), REFUSED),
    _mesh("vtp: no end", "egg.vtp", TEXT["vtp"], REFUSED, damage.replaced(b"</VTKFile>", b"")),
    _mesh(
        "vtp: the other byte order",
        "egg.vtp",
        BINARY["vtp"],
        REFUSED,
        damage.replaced(b"LittleEndian", b"BigEndian"),
    ),
    _mesh(
        "vtp: another data set", "egg.vtp", BINARY["vtp"], REFUSED, damage.replaced(b"PolyData", b"HyperTree")
    ),
    _mesh(
        "vtp: fewer points",
        "egg.vtp",
        TEXT["vtp"],
        REFUSED,
        damage.replaced(b'NumberOfPoints="642"', b'NumberOfPoints="600"'),
    ),
    _mesh(
        "vtp: more points",
        "egg.vtp",
        TEXT["vtp"],
        REFUSED,
        damage.replaced(b'NumberOfPoints="642"', b'NumberOfPoints="700"'),
    ),
    _mesh(
        "vtp: two billion polygons",
        "egg.vtp",
        TEXT["vtp"],
        REFUSED,
        damage.replaced(b'NumberOfPolys="1280"', b'NumberOfPolys="2000000000"'),
    ),
]
_DRACO: dict[str, object] = {
    "extensionsUsed": ["KHR_draco_mesh_compression"],
    "extensionsRequired": ["KHR_draco_mesh_compression"],
}
_PACKED: dict[str, object] = {"extensionsRequired": ["EXT_meshopt_compression"]}
_GLB = [
    _mesh(
        "glb: millimetres as metres",
        "egg.glb",
        partial(shapes.glb, triangles(), factor=1000.0),
        whole(EGG, "either"),
    ),
    _mesh("glb: lines", "egg.glb", partial(shapes.glb, triangles(), 1), REFUSED),
    _mesh("glb: points", "egg.glb", partial(shapes.glb, triangles(), 0), part("either")),
    _mesh("glb: Draco", "egg.glb", partial(shapes.glb, triangles(), change=_DRACO), REFUSED),
    _mesh("glb: meshopt", "egg.glb", partial(shapes.glb, triangles(), change=_PACKED), REFUSED),
    _mesh("glb: no mesh", "egg.glb", partial(shapes.glb, triangles(), change={"meshes": []}), REFUSED),
    _mesh(
        "glb: no scene",
        "egg.glb",
        partial(shapes.glb, triangles(), change={"scenes": [], "nodes": []}),
        REFUSED,
    ),
    _mesh("glb: an empty record", "egg.glb", lambda: shapes.glb_of({}, b""), REFUSED),
    _mesh("glb: version 1", "egg.glb", BINARY["glb"], REFUSED, damage.replaced(b"glTF\2", b"glTF\1")),
    _mesh(
        "glb: a long buffer",
        "egg.glb",
        BINARY["glb"],
        whole(EGG, "either"),
        damage.replaced(b'"byteLength": 23064', b'"byteLength": 93064'),
    ),
    _mesh("glb: bytes more", "egg.glb", BINARY["glb"], whole(EGG), damage.ended_with(bytes(8))),
    _mesh(
        "glb: a name in the record",
        "egg.glb",
        partial(shapes.glb, triangles(), change={"extras": {"name": "é"}}),
        whole(EGG),
    ),
]


def _shape(name: str, shape: Shape, expected: Expected, *more: str, file: str = "egg.ply") -> Case:
    write = shapes.stl if file.endswith("stl") else partial(shapes.ply, real="double")
    return _mesh(f"shape: {name}", file, partial(write, shape), expected, words=more)


def _without(start: int, stop: int) -> Shape:
    polygons = triangles().polygons
    return Shape(triangles().points, [*polygons[:start], *polygons[stop:]])


def _with_points(points: ArrayLike, every: slice) -> Shape:
    moved = triangles().points.copy()
    moved[every] = points
    return Shape(moved, triangles().polygons)


def _soup(jitter_mm: float = 0.0) -> Shape:
    """Every triangle with corners of its own, each a little off."""
    corners = triangles().points[triangles().triangles].reshape(-1, 3)
    off = np.random.default_rng(0).normal(0, jitter_mm, corners.shape) if jitter_mm else 0.0
    return Shape(corners + off, np.arange(len(corners)).reshape(-1, 3).tolist())


def _open_below(height_mm: float) -> Shape:
    """What lies above a height."""
    points = triangles().points
    kept = [p for p in triangles().polygons if points[list(p), 2].min() > height_mm]
    return Shape(points, kept)


def _more_points(points: ArrayLike) -> Shape:
    return Shape(np.concatenate([triangles().points, np.atleast_2d(points)]), triangles().polygons)


_HALF = triangles().moved(0.5)
_REPEATED = Shape(triangles().points, [*triangles().polygons, *triangles().polygons[:300]])
_SLIVERS = Shape(triangles().points, [*triangles().polygons, [0, 0, 1], [5, 6, 5], [7, 7, 7]])
_DEBRIS = triangles().moved(0.01, (30.0, 25.0, 0.0))
_SHAPES = [
    *(
        _shape(f"in {unit}", triangles().moved(factor), whole(EGG))
        for unit, factor in (("metres", 0.001), ("centimetres", 0.1), ("micrometres", 1000.0))
    ),
    _shape("in inches", triangles().moved(1 / 25.4), REFUSED),
    _shape("in inches, told", triangles().moved(1 / 25.4), whole(EGG), "--scale", "25.4"),
    _shape("in metres, told", triangles().moved(0.001), whole(EGG), "--scale", "1000"),
    _shape("mirrored", triangles().moved(np.diag([-1.0, 1.0, 1.0])), whole(EGG)),
    _shape("inside out", triangles().turned_round(), whole(EGG)),
    _shape("a third inside out", triangles().turned_round(slice(0, 400)), whole(EGG)),
    _shape("every other face inside out", triangles().turned_round(slice(0, None, 2)), whole(EGG)),
    _shape("a soup of triangles", _soup(), whole(EGG)),
    _shape("a soup with gaps of a nanometre", _soup(1e-6), whole(EGG)),
    _shape("a soup of single precision", _soup(), whole(EGG), file="egg.stl"),
    _shape("faces twice", _REPEATED, whole(EGG)),
    _shape("the egg twice", triangles() + triangles(), whole(EGG)),
    _shape("a double sheet", triangles() + triangles().moved(1.00001), whole(EGG, "either")),
    _shape("an egg within", triangles() + _HALF, whole(EGG, "either")),
    _shape("overlapping", triangles() + triangles().moved(0.9, (0, 0, 3.0)), whole(EGG, "either")),
    _shape("faces without area", _SLIVERS, whole(EGG)),
    _shape("a point far away that no face uses", _more_points([0, 0, 9000.0]), whole(EGG)),
    _shape("a point that is no number and no face uses", _more_points([np.nan] * 3), whole(EGG, "either")),
    _shape("debris inside the box", triangles() + _DEBRIS, whole(EGG)),
    _shape(
        "debris far away",
        triangles() + _DEBRIS.moved(1.0, (900, 0, 0)),
        whole(EGG, "either", says="component|piece|debris|far"),
    ),
    _shape("a face missing", _without(100, 101), part()),
    _shape("ten faces missing", _without(100, 110), part()),
    _shape("the upper two thirds", _open_below(-10.0), part()),
    _shape("the upper third", _open_below(12.0), part()),
    _shape("quads", quads(), whole(GLOBE)),
    _shape(
        "one polygon of many corners",
        Shape(
            quads().points,
            [p for p in quads().polygons if len(p) == 4] + [[*range(31, -1, -1)], [*range(704, 736)]],
        ),
        whole(GLOBE),
    ),
    _shape("not a number", _with_points(np.nan, slice(7, 8)), REFUSED),
    _shape("infinite", _with_points(np.inf, slice(7, 8)), REFUSED),
    _shape("1e30", _with_points(1e30, slice(7, 8)), REFUSED),
    _shape("1e300", _with_points(1e300, slice(7, 8)), REFUSED),
    _shape("all zero", triangles().moved(0.0), REFUSED),
    _shape("flat", triangles().moved(np.diag([1.0, 1.0, 0.0])), REFUSED),
    _shape("a line", triangles().moved(np.diag([0.0, 0.0, 1.0])), REFUSED),
    _shape("far away", triangles().moved(1.0, (5000.0, 0.0, 0.0)), REFUSED),
    _shape("one triangle", Shape(triangles().points[:3], [[0, 1, 2]]), REFUSED),
    _shape(
        "a tetrahedron", Shape(20 * np.eye(4)[:, :3], [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]), REFUSED
    ),
    _shape("no faces", Shape(triangles().points, []), part("either")),
    _shape("no points", Shape(np.zeros((0, 3)), []), REFUSED),
    _shape("missing vertices", Shape(triangles().points[:600], triangles().polygons), REFUSED),
    _shape("negative vertices", Shape(triangles().points, [*triangles().polygons, [-5, 1, 2]]), REFUSED),
    _shape("faces of two corners", Shape(triangles().points, [[0, 1], [1, 2], [2, 3]]), part("either")),
    _shape("a thousand times as large", triangles().moved(1e6), REFUSED),
    _shape(
        "voxel indices",
        Shape(np.round(triangles().points), triangles().polygons),
        whole(EGG, "either", says="voxel"),
    ),
]
_WITHIN: Mapping[str, tuple[Ending, int]] = {
    "stl": ("either", 84),
    "ply": ("either", 300),
    "vtk": ("either", 80),
    "vtp": ("either", 400),
    "glb": ("either", 900),
}
_BROKEN = [
    *(
        _mesh(f"{ending} cut at {share}", f"egg.{ending}", good, REFUSED, damage.cut(share))
        for ending, good in BINARY.items()
        for share in (0.002, 0.05, 0.35, 0.6, 0.97)
    ),
    *(
        _mesh(f"{ending} without its last 3 bytes", f"egg.{ending}", good, REFUSED, damage.short(3))
        for ending, good in BINARY.items()
        if ending != "vtp"
    ),
    *(
        _mesh(
            f"text {ending} cut at {share}",
            f"egg.{ending}",
            good,
            REFUSED if ending != "obj" else part("either"),
            damage.cut(share),
        )
        for ending, good in TEXT.items()
        for share in (0.05, 0.35, 0.8)
    ),
    *(
        _mesh(
            f"{ending} with {count} flips {turn}",
            f"egg.{ending}",
            good,
            whole(EGG, "either"),
            damage.flip(count),
        )
        for ending, good in BINARY.items()
        for count, turn in ((1, "a"), (1, "b"), (20, "a"), (500, "a"))
    ),
    *(
        _mesh(
            f"{ending} with flips in the header {turn}",
            f"egg.{ending}",
            good,
            whole(EGG, "either"),
            damage.flip(2, 0, _WITHIN[ending][1]),
        )
        for ending, good in BINARY.items()
        for turn in "abc"
    ),
    *(
        _mesh(
            f"text {ending} with 5 flips {turn}", f"egg.{ending}", good, whole(EGG, "either"), damage.flip(5)
        )
        for ending, good in TEXT.items()
        for turn in "ab"
    ),
    *(
        _mesh(
            f"{ending} with swapped blocks",
            f"egg.{ending}",
            good,
            whole(EGG, "either"),
            damage.swap(512, 1024),
        )
        for ending, good in BINARY.items()
    ),
    *(
        _mesh(f"{ending} with a hole", f"egg.{ending}", good, REFUSED, damage.hole(777))
        for ending, good in BINARY.items()
    ),
    *(
        _mesh(f"{ending} with zeros", f"egg.{ending}", good, whole(EGG, "either"), damage.zeros(2000))
        for ending, good in BINARY.items()
    ),
    *(
        _mesh(
            f"{one} goes on as {other}",
            f"egg.{one}",
            BINARY[one],
            whole(EGG, "either"),
            damage.joined(BINARY[other]()),
        )
        for one, other in (("stl", "ply"), ("ply", "stl"), ("vtk", "ply"), ("glb", "stl"))
    ),
    *(
        _mesh(f"{what} named .{ending}", f"egg.{ending}", lambda content=content: content, REFUSED)
        for ending in ("stl", "ply", "obj", "vtk", "vtp", "glb")
        for what, content in damage.STRANGERS.items()
        if ending in ("stl", "ply") or what in ("nothing", "a web page", "zeros")
    ),
    *(
        special(KIND, what, f"egg.{ending}", REFUSED)
        for what, ending in zip(Special, ("stl", "ply", "obj"), strict=True)
    ),
    _mesh("stl: a header alone", "egg.stl", lambda: shapes.stl(Shape(np.zeros((0, 3)), [])), REFUSED),
    _mesh("stl: 40 bytes", "egg.stl", lambda: b"solid" + bytes(35), REFUSED),
    _mesh("stl: a count alone", "egg.stl", lambda: bytes(80) + struct.pack("<I", 4_000_000_000), REFUSED),
]
CASES = (*_WRITTEN, *_STL, *_PLY, *_OBJ, *_VTK, *_GLB, *_SHAPES, *_BROKEN)
