"""Reading surface meshes, repairing small faults and turning down what is not the surface of a body.

:func:`sound_mesh` does all of it. Coordinates are taken as millimetres, save where a format says otherwise:
GLB is in metres with y up, and is scaled and turned.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Literal, NamedTuple

import igl
import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from naisr_model.data import formats
from naisr_model.data.outside import outside
from naisr_model.data.readers import glb, obj, ply, stl, vtk
from naisr_model.data.readers.parts import Parts, check_indices
from naisr_model.data.remarks import Remark
from naisr_model.errors import InputError
from naisr_model.exports import GLB_TO_MM

READERS = {f".{ending}" for ending in formats.MESHES}
"""The usual endings of the files that :func:`read_file` knows; it goes by their content."""

OPEN_SHARE = 0.1
"""Largest |sum of area vectors| / area: 0 for a closed surface, 0.5 for a cup, 1 for a plane."""

FLAT_SHARE = 1e-3
"""Smallest volume, as a share of that of the sphere with the same area."""

SLIT_SHARE = 1e-4
"""Holes with less of the area are slits: what a surface encloses is known all the same."""

OVERLAP_SHARE = 5e-3
"""Of the area; where more of it lies inside the shape or twice, the outside is taken alone."""

GAP_SHARE = 1e-3
"""Of the usual edge; corners of open edges that are nearer to each other were rounded apart."""

_CORNERS = 12
"""So many triangles that were written one by one have a corner at the same place, rarely more."""

FAR = 1.0
"""Pieces further from the main one than this share of its longest side are debris."""

LARGEST = 1e9
"""Of a coordinate, in any unit; what is larger is no length of a body."""

LONGEST_GAP = 10
"""Vertices at the origin, or faces that are nothing but a vertex, in a row: zeros in the file."""

SPIKE = 20.0
"""Vertices further from the middle than so many times what nine of ten others are."""

CRISS_CROSS = 0.02
"""Share of the area beside which a surface winds the wrong way round, from which on it has no outside."""

_READ: dict[str, Callable[[str, bytes], Parts]] = {
    "stl": stl.read,
    "ply": ply.read,
    "obj": obj.read,
    "vtk": vtk.read,
    "vtp": vtk.read_xml,
    "glb": glb.read,
}


class MeshFile(NamedTuple):
    """What was read from the file of a mesh.

    Attributes:
        mesh_mm: the surface, or points without faces.
        from_file: 4x4, coordinates of the file to those of ``mesh_mm``.
        space: ``LPS`` or ``RAS`` where the file says it, else empty.
        remarks: what is odd about the file, and what was repaired.
    """

    mesh_mm: trimesh.Trimesh
    from_file: NDArray[np.float64]
    space: Literal["LPS", "RAS", ""]
    remarks: tuple[Remark, ...]


def read_mesh(path: str | Path) -> trimesh.Trimesh:
    """Read one triangle mesh as :func:`read_file` does, and refuse a cloud of points.

    Raises:
        InputError: as :func:`read_file`, and when there are no faces.
    """
    return _with_faces(path, read_file(path)).mesh_mm


def sound_mesh(path: str | Path) -> MeshFile:
    """Read a mesh, set right what can be set right, and refuse what bounds no body.

    Raises:
        InputError: as :func:`read_mesh` and :func:`check_mesh`.
    """
    file = _with_faces(path, read_file(path))
    mesh, mended = repair_mesh(file.mesh_mm)
    stated = (
        (Remark("look", "space", "the file says that its coordinates are RAS"),)
        if file.space == "RAS"
        else ()
    )
    return file._replace(mesh_mm=mesh, remarks=(*file.remarks, *mended, *stated, *check_mesh(mesh)))


def _with_faces(path: str | Path, file: MeshFile) -> MeshFile:
    if not len(file.mesh_mm.faces):
        raise InputError(f"{Path(path).name} has no faces; it is a cloud of points, give a surface")
    return file


def read_file(path: str | Path, others: Iterable[str] = ()) -> MeshFile:
    """Read a mesh or points from a file, by its content; polygons are triangulated, nothing is repaired.

    Args:
        path: an STL, PLY, OBJ, VTK, VTP or GLB file.
        others: endings of what the caller could read besides; named where it is none of these.

    Raises:
        InputError: when the file is missing, of another kind, cut off, without surface and points, or has a
            coordinate that is not finite or a face whose vertices are missing.
    """
    path = Path(path)
    content = formats.plain(formats.content_of(path))
    ending = path.suffix.lower().removeprefix(".")
    kind = formats.format_of(content, ending)
    if not kind:
        raise formats.refuse_foreign(path.name, content, ", ".join(sorted({*READERS, *others})))
    parts = _parts(path.name, kind, content)
    mesh = trimesh.Trimesh(parts.points, parts.faces, process=False)
    named = () if kind == ending else (_misnamed(kind),)
    if kind != "glb":
        return MeshFile(mesh, np.eye(4), _stated_space(content), (*named, *parts.remarks))
    mesh.apply_transform(GLB_TO_MM)
    convention = "metres with y up, as GLB files are: it was scaled by 1000 and turned so that z is up"
    turned = Remark("fine", "convention", f"the file was taken to be in {convention}")
    return MeshFile(mesh, GLB_TO_MM, "", (*named, *parts.remarks, turned))


def _misnamed(kind: str) -> Remark:
    return Remark(
        "fine", "name", f"the content is {formats.MESHES[kind]}, whatever the name says: it was read so"
    )


def _parts(name: str, kind: str, content: bytes) -> Parts:
    try:
        with np.errstate(
            invalid="ignore", over="ignore"
        ):  # of damaged files; what is no number is refused below
            parts = _READ[kind](name, content)
    except InputError:
        raise
    except Exception as error:  # the readers raise whatever they like on damaged files
        raise InputError(
            f"{name} is a damaged {formats.MESHES[kind]} file and cannot be read; copy or export it again"
        ) from error
    if parts.lines and not len(parts.faces):
        raise InputError(f"{name} holds lines, no surface; export the surface itself")
    if not len(parts.points):
        raise InputError(f"{name} has no faces and no points; export it again")
    _refuse_damage(name, parts)
    if len(parts.faces):
        return parts
    sentence = (
        f"the {formats.MESHES[kind]} file holds points and no faces: it was taken for a cloud of points"
    )
    cloud = Remark("look", "cloud", sentence, "if it should be a surface, it is cut off: export it again")
    return parts._replace(remarks=(*parts.remarks, cloud))


def _refuse_damage(name: str, parts: Parts) -> None:
    """What every format can suffer: no numbers, numbers of no size, stretches that were not copied."""
    bad = int((~np.isfinite(parts.points)).any(axis=1).sum())
    if bad:
        share = f"{bad:,} of {len(parts.points):,} vertices"
        raise InputError(f"{name} has {share} that are not finite numbers; export it again")
    largest = float(np.abs(parts.points).max())
    if largest > LARGEST:
        raise InputError(
            f"{name} has a coordinate of {largest:.2g}, so it is damaged; copy or export it again"
        )
    check_indices(name, parts.faces.ravel(), len(parts.points))
    zeros = _longest_run(np.asarray(~parts.points.any(axis=1)))
    dots = _longest_run((parts.faces[:, 0] == parts.faces[:, 1]) & (parts.faces[:, 0] == parts.faces[:, 2]))
    if max(zeros, dots) >= LONGEST_GAP:
        what = f"{zeros:,} vertices" if zeros >= dots else f"{dots:,} faces"
        raise InputError(f"{name} was not copied whole: {what} in a row are zeros; copy or export it again")


def _longest_run(applies: NDArray[np.bool_]) -> int:
    ends = np.flatnonzero(np.diff(np.concatenate([[0], applies.astype(np.int8), [0]])))
    return int((ends[1::2] - ends[::2]).max(initial=0))


def _stated_space(content: bytes) -> Literal["LPS", "RAS", ""]:
    """What 3D Slicer writes at the start of a mesh file."""
    start = content[:1024]
    return "RAS" if b"SPACE=RAS" in start else "LPS" if b"SPACE=LPS" in start else ""


def repair_mesh(mesh: trimesh.Trimesh) -> tuple[trimesh.Trimesh, tuple[Remark, ...]]:
    """Mend a mesh as :func:`mended_mesh` does and turn its faces outward as :func:`faced_outward` does."""
    mesh, mended = mended_mesh(mesh)
    return faced_outward(mesh), mended


def mended_mesh(mesh: trimesh.Trimesh) -> tuple[trimesh.Trimesh, tuple[Remark, ...]]:
    """Clean a mesh as :func:`cleaned` does, and take the outside of one that overlaps itself.

    Returns:
        The mesh, and what was done that a person has to know.

    Raises:
        InputError: when its faces cross each other all over, so that it has no outside.
    """
    mesh = cleaned(mesh)
    without_walls = _without_inner_walls(mesh)
    walls = len(mesh.faces) - len(without_walls.faces)
    said = (
        (Remark("fine", "walls", f"{walls:,} faces of walls inside the shape were left out"),)
        if walls
        else ()
    )
    share = overlap_share(without_walls)
    if share <= OVERLAP_SHARE:
        return without_walls, said
    outer, pieces = _without_inner_pieces(faced_outward(without_walls))
    if pieces and overlap_share(outer) <= OVERLAP_SHARE:
        sentence = f"{_counted(pieces)} inside the shape counted for nothing, with faces that look outward"
        return outer, (
            *said,
            Remark("look", "overlap", sentence, "if that is a cavity, turn its faces round"),
        )
    if (_windings(without_walls) < -0.5).any(axis=1).mean() > CRISS_CROSS:
        raise InputError("the faces cross each other all over, so the shape has no outside; export it again")
    whole, side_mm = outside(faced_outward(without_walls))
    sentence = (
        f"{100 * share:.0f} % of the surface lies inside the shape or twice (pieces that overlap, double "
        f"sheets or inner walls): its outside was taken, sampled every {side_mm:.2g} mm"
    )
    return whole, (
        *said,
        Remark("look", "overlap", sentence, "join the pieces into one surface to keep its detail"),
    )


def _counted(pieces: int) -> str:
    return "a closed piece" if pieces == 1 else f"{pieces} closed pieces"


def cleaned(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Merge duplicated vertices, drop collapsed and repeated faces, and wind neighbours alike.

    Corners of open edges that rounding took apart become one, see :data:`GAP_SHARE`.
    Faces without area that have three corners are kept: without them there would be a slit.
    """
    mesh = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    faces = _welded(np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64))
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    once = _without_doubles(faces)
    # Where surfaces touch, the same face twice may be what closes them.
    opens = len(once) < len(faces) and not _odd_edges(faces) and _odd_edges(once)
    mesh = trimesh.Trimesh(mesh.vertices, faces if opens else once, process=False)
    mesh.remove_unreferenced_vertices()
    if not len(mesh.faces) or mesh.is_winding_consistent:
        return mesh
    faces, _ = igl.bfs_orient(np.asarray(mesh.faces, np.int64))
    return trimesh.Trimesh(mesh.vertices, faces, process=False)


def _welded(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """Faces whose open edges share their ends where these are nearer than :data:`GAP_SHARE`."""
    edge, count = _edges(faces)
    open_sides = (count % 2 == 1)[edge].reshape(-1, 3)
    if not open_sides.any():
        return faces
    sides = vertices[faces] - vertices[np.roll(faces, -1, axis=1)]
    gap = GAP_SHARE * float(np.median(np.linalg.norm(sides, axis=2)))
    ends = np.unique(np.concatenate([faces[open_sides], np.roll(faces, -1, axis=1)[open_sides]]))
    near, other = cKDTree(vertices[ends]).query(vertices[ends], _CORNERS, distance_upper_bound=gap)
    one = np.repeat(np.arange(len(ends)), _CORNERS).reshape(-1, _CORNERS)[np.isfinite(near)]
    graph = coo_array((np.ones(len(one)), (one, other[np.isfinite(near)])), (len(ends), len(ends)))
    _, first, group = np.unique(connected_components(graph)[1], return_index=True, return_inverse=True)
    target = np.arange(len(vertices))
    target[ends] = ends[first[group]]
    return target[faces]


def _without_doubles(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """Of faces with the same corners one; none where both sides of a wall inside the surface were written.

    Such a wall, unlike a surface whose faces are all written from both sides, ends at edges that the rest
    closes without it.
    """
    if not len(faces):
        return faces
    order = np.argsort(faces, axis=1)
    turns = np.where(np.linalg.det(np.eye(3)[order]) > 0, 1, -1)
    corners, index, count = np.unique(
        np.take_along_axis(faces, order, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    if (count == 1).all():
        return faces
    net = np.bincount(index.ravel(), weights=turns)
    once = np.where((net >= 0)[:, None], corners, corners[:, ::-1])
    both = np.flatnonzero((count > 1) & (net == 0))
    if len(both) > len(once) / 2:
        return once
    patch = np.asarray(igl.facet_components(once[both])[1]) if len(both) else np.zeros(0, np.int64)
    walls = [both[patch == i] for i in np.unique(patch) if _is_wall(once, both[patch == i])]
    return np.delete(once, np.concatenate([np.zeros(0, np.int64), *walls]), axis=0)


def _is_wall(faces: NDArray[np.int64], patch: NDArray[np.int64]) -> bool:
    """Whether the rest of the faces has an even number at most edges where the patch ends."""
    edge, count = _edges(faces)
    edge = edge.reshape(-1, 3)
    inside = np.bincount(edge[patch].ravel(), minlength=len(count))
    ends = inside % 2 == 1
    return bool(ends.any()) and bool((((count - inside)[ends] % 2) == 0).mean() > 0.5)


def _edges(faces: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The number of the edge at each side of each face ``[3 m]``, and how many faces each edge has."""
    ends = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    keys = ends[:, 0] * (int(faces.max(initial=0)) + 1) + ends[:, 1]
    _, index, count = np.unique(keys, return_inverse=True, return_counts=True)
    return index, count


def _odd_edges(faces: NDArray[np.int64]) -> int:
    """How many edges have an odd number of faces, as none of a closed surface has."""
    return int((_edges(faces)[1] % 2).sum())


def _without_inner_walls(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Leave out open sheets inside a surface that is closed without them."""
    vertices, faces = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64)
    if not len(faces):
        return mesh
    edge, count = _edges(faces)
    odd = (count % 2 == 1)[edge].reshape(-1, 3).any(axis=1)
    if not odd.any():
        return mesh
    patch = np.asarray(igl.extract_manifold_patches(faces)[1])
    open_patches = np.unique(patch[odd])
    if len(open_patches) > _MOST_WALLS:
        return mesh
    inner = [i for i in open_patches if _lies_inside(vertices, faces[patch == i], faces[patch != i])]
    kept = trimesh.Trimesh(vertices, faces[~np.isin(patch, inner)], process=False)
    if not len(kept.faces) or not is_closed(kept):
        return mesh
    kept.remove_unreferenced_vertices()
    return kept


_MOST_WALLS = 100


def _without_inner_pieces(mesh: trimesh.Trimesh) -> tuple[trimesh.Trimesh, int]:
    """Leave out closed components that look outward inside the others; also says how many."""
    vertices, faces = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64)
    component = np.asarray(igl.facet_components(faces)[1])
    volume = _bulk(vertices, faces, component).volume
    inner = [
        i
        for i in np.flatnonzero(volume > 0)[:_MOST_WALLS]
        if _lies_inside(vertices, faces[component == i], faces[component != i], wholly=True)
    ]
    if not inner:
        return mesh, 0
    kept = trimesh.Trimesh(vertices, faces[~np.isin(component, inner)], process=False)
    kept.remove_unreferenced_vertices()
    return kept, len(inner)


def _lies_inside(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], others: NDArray[np.int64], wholly: bool = False
) -> bool:
    """Whether most of some of the faces, or all of more of them, lie inside the others."""
    if not len(others):
        return False
    middles = vertices[faces[:: max(1, len(faces) // (1000 if wholly else 20))]].mean(axis=1)
    inside = np.abs(_winding(vertices, others, middles)) > 0.5
    return bool(inside.all() if wholly else inside.mean() > 0.5)


def overlap_share(mesh: trimesh.Trimesh) -> float:
    """Share of a closed surface's area that does not part inside from outside; 0 of what bounds no body.

    Just inside such a surface the winding number is 1 and just outside 0; where pieces overlap or sheets are
    double it is more, on both sides of a wall alike. Judged at :data:`OVERLAP_SAMPLES` points.
    """
    return float((np.abs(_windings(mesh) - [1, 0]) >= 0.5).any(axis=1).mean())


def _windings(mesh: trimesh.Trimesh) -> NDArray[np.float64]:
    """Winding numbers just inside and just outside a surface, ``[n, 2]``; of what bounds no body 1 and 0."""
    mesh = faced_outward(mesh)
    if not is_closed(mesh) or is_flat(mesh):
        return np.array([[1.0, 0.0]])
    vertices, faces = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64)
    points, chosen = trimesh.sample.sample_surface(mesh, OVERLAP_SAMPLES, seed=0)
    step = _STEP * float(np.ptp(vertices, axis=0).max()) * np.asarray(mesh.face_normals)[chosen]
    within = _winding(vertices, faces, np.ascontiguousarray(points - step))
    beyond = _winding(vertices, faces, np.ascontiguousarray(points + step))
    return np.stack([within, beyond], axis=1)


OVERLAP_SAMPLES = 2000
_STEP = 1e-5


def faced_outward(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Turn round each component that is inside out, unless it lies within the others as a cavity."""
    if not len(mesh.faces):
        return mesh
    vertices, faces = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64)
    return trimesh.Trimesh(vertices, _face_outward(vertices, faces), process=False)


def _face_outward(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """Turn round the components whose faces look inward, ``faces`` being consistently wound.

    Open patches, such as the islands between missing faces, have no inside and are left alone.
    """
    component = igl.facet_components(faces)[1]
    bulk = _bulk(vertices, faces, component)
    inward = (bulk.volume < 0) & (bulk.opening <= OPEN_SHARE)
    positive = np.where(inward[component][:, None], faces[:, ::-1], faces)
    for i in np.flatnonzero(inward):
        others = positive[component != i]
        inside = len(others) and _winding(vertices, others, vertices[faces[component == i][:1, 0]])[0] > 0.5
        inward[i] = not inside
    return np.where(inward[component][:, None], faces[:, ::-1], faces)


class _Bulk(NamedTuple):
    """Of each group of faces: signed volume, area, and the opening that :data:`OPEN_SHARE` limits."""

    volume: NDArray[np.float64]
    area: NDArray[np.float64]
    opening: NDArray[np.float64]


def _bulk(vertices: NDArray[np.float64], faces: NDArray[np.int64], group: NDArray[np.int64]) -> _Bulk:
    corners = vertices[faces]
    vectors = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    middles = corners.mean(axis=1)
    # About the group's own centre, so that a small hole changes the volume little.
    centres = _sums(middles, group) / np.bincount(group)[:, None]
    heights = np.einsum("ij,ij->i", middles - centres[group], vectors)
    area = _sums(np.linalg.norm(vectors, axis=1)[:, None], group)[:, 0]
    opening = np.linalg.norm(_sums(vectors, group), axis=1) / np.maximum(area, np.finfo(float).tiny)
    return _Bulk(_sums(heights[:, None], group)[:, 0] / 3, area, opening)


def _sums(rows: NDArray[np.float64], group: NDArray[np.int64]) -> NDArray[np.float64]:
    """Sum the rows of each group, ``[n, k] -> [groups, k]``."""
    return np.stack([np.bincount(group, weights=column) for column in rows.T], axis=1)


def _winding(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], points: NDArray[np.float64]
) -> NDArray[np.float64]:
    return np.asarray(igl.fast_winding_number(vertices, np.ascontiguousarray(faces), points))


def check_mesh(mesh: trimesh.Trimesh) -> tuple[Remark, ...]:
    """Decide whether a repaired mesh bounds a body.

    Returns:
        What is odd but bearable: holes and slits, several components, pieces far away.

    Raises:
        InputError: when there are no faces, or the surface is flat or open.
    """
    if not len(mesh.faces):
        raise InputError("the mesh has no faces; check how it was exported")
    opened = float(_whole(mesh).opening[0])
    if opened > OPEN_SHARE:
        raise InputError(f"the surface is open (opening {100 * opened:.0f} % of its area); close its holes")
    if is_flat(mesh):
        raise InputError("the surface encloses no volume; it must bound a body")
    found = (opening(mesh), components(mesh), debris(mesh, far_points(mesh)), spikes(mesh))
    return tuple(remark for remark in found if remark)


def is_flat(mesh: trimesh.Trimesh) -> bool:
    """Whether a surface with outward faces encloses next to nothing for its area."""
    whole = _whole(mesh)
    return bool(whole.volume[0] < FLAT_SHARE * whole.area[0] ** 1.5 / (6 * np.sqrt(np.pi)))


def _whole(mesh: trimesh.Trimesh) -> _Bulk:
    """Of all faces together."""
    faces = np.asarray(mesh.faces, np.int64)
    return _bulk(np.asarray(mesh.vertices, np.float64), faces, np.zeros(len(faces), dtype=np.int64))


def opening(mesh: trimesh.Trimesh) -> Remark | None:
    """What is to be said of holes, and of slits, which do no harm."""
    edges = len(rim(mesh))
    if not edges:
        return None
    holes, share = hole_areas_mm2(mesh), open_share(mesh)
    if share <= SLIT_SHARE:
        return Remark(
            "fine", "slits", f"{edges:,} edges have one face only, along slits: it counts as closed"
        )
    count = "a hole" if len(holes) == 1 else f"{len(holes):,} holes"
    percent = f"{100 * share:.1f}" if share > 5e-4 else f"{100 * share:.2g}"
    sentence = f"the surface is open: {count} of {percent} % of its area, with {edges:,} open edges"
    return Remark("look", "open", sentence, "close it if the shape is whole")


def components(mesh: trimesh.Trimesh) -> Remark | None:
    """What is to be said of several components."""
    areas = component_areas(mesh)[1]
    if len(areas) < 2:
        return None
    largest = areas.max() / areas.sum()
    sentence = f"the surface has {len(areas)} components; the largest has {100 * largest:.1f} % of the area"
    return Remark("look", "components", sentence, "remove those that do not belong to the shape")


def component_areas(mesh: trimesh.Trimesh) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """The component of each face ``[m]``, and the area of each."""
    component = np.asarray(igl.facet_components(np.asarray(mesh.faces, np.int64))[1])
    return component, np.bincount(component, weights=mesh.area_faces).astype(np.float64)


def debris(mesh: trimesh.Trimesh, far: NDArray[np.bool_]) -> Remark | None:
    """What is to be said of the points that :func:`far_points` found."""
    if not far.any():
        return None
    points = np.asarray(mesh.vertices)
    away_mm = cKDTree(points[~far]).query(points[far][:: max(1, int(far.sum()) // _FEW_POINTS)])[0]
    share = 100 * _area_share(mesh, far)
    sentence = f"{share:.2g} % of it lies {away_mm.min():.0f} to {away_mm.max():.0f} mm from the main piece"
    return Remark("look", "debris", sentence, "remove them if they do not belong to the shape")


def spikes(mesh: trimesh.Trimesh) -> Remark | None:
    """What is to be said of vertices far out that hang together with the others."""
    points = np.asarray(mesh.vertices, np.float64)
    away = np.linalg.norm(points - np.median(points, axis=0), axis=1)
    far = (away > SPIKE * np.quantile(away, 0.9)) & ~far_points(mesh)
    if not far.any():
        return None
    sentence = f"{int(far.sum()):,} vertices lie up to {away[far].max():.3g} mm out, as spikes"
    return Remark("look", "spikes", sentence, "export the surface again, or remove them")


def _area_share(mesh: trimesh.Trimesh, points: NDArray[np.bool_]) -> float:
    """Share of the surface that some of its points make up; of a cloud, share of the points."""
    if not len(mesh.faces):
        return float(points.mean())
    area = np.asarray(mesh.area_faces)
    return float(area[points[np.asarray(mesh.faces)[:, 0]]].sum() / area.sum())


def far_points(mesh: trimesh.Trimesh) -> NDArray[np.bool_]:
    """Which vertices belong to components :data:`FAR` from the largest, ``[n]``; of a cloud, outliers."""
    points = np.asarray(mesh.vertices, np.float64)
    far = np.zeros(len(points), dtype=bool)
    if not len(mesh.faces):
        away = np.linalg.norm(points - np.median(points, axis=0), axis=1)
        return np.asarray(away > _OUTLYING * np.quantile(away, 0.9))
    component, areas = component_areas(mesh)
    if len(areas) < 2:
        return far
    of_point = np.zeros(len(points), np.int64)
    of_point[np.asarray(mesh.faces).ravel()] = np.repeat(component, 3)
    main = points[of_point == areas.argmax()]
    limit = FAR * float(np.ptp(main, axis=0).max())
    some = np.flatnonzero(of_point != areas.argmax())
    some = some[:: max(1, len(some) // _FEW_POINTS)]
    # Every component has a say, however few points it has.
    some = np.union1d(some, np.unique(of_point, return_index=True)[1])
    away = cKDTree(main[:: max(1, len(main) // _FEW_POINTS)]).query(points[some])[0]
    nearest = np.full(len(areas), np.inf)
    np.minimum.at(nearest, of_point[some], away)
    nearest[areas.argmax()] = 0
    return np.asarray(nearest > limit)[of_point]


_FEW_POINTS = 20_000
_OUTLYING = 5.0


def is_closed(mesh: trimesh.Trimesh) -> bool:
    """Whether a surface bounds a body, so that its volume means something; slits do not open it."""
    return bool(len(mesh.faces)) and open_share(mesh) <= SLIT_SHARE


def open_share(mesh: trimesh.Trimesh) -> float:
    """Share of the holes in the area of a surface with its holes."""
    holes = float(hole_areas_mm2(mesh).sum())
    return holes / (holes + float(mesh.area)) if holes else 0.0


def hole_areas_mm2(mesh_mm: trimesh.Trimesh) -> NDArray[np.float64]:
    """Area of each hole of a surface whose faces are wound alike, ``[holes]``.

    The area vector of a rim is the sum of p x q / 2 over its directed edges.
    """
    edges, points = rim(mesh_mm), np.asarray(mesh_mm.vertices)
    if not len(edges):
        return np.zeros(0)
    graph = coo_array((np.ones(len(edges)), edges.T), (len(points), len(points)))
    hole = connected_components(graph)[1][edges[:, 0]]
    points = points - points[edges].mean(axis=(0, 1))
    vectors = np.cross(points[edges[:, 0]], points[edges[:, 1]]) / 2
    areas = np.linalg.norm([np.bincount(hole, weights=column) for column in vectors.T], axis=0)
    return areas[np.unique(hole)]


def rim(mesh: trimesh.Trimesh) -> NDArray[np.int64]:
    """The edge of an open surface: directed edges that no neighbour runs along the other way, ``[n, 2]``."""
    faces = np.asarray(mesh.faces, np.int64)
    index, _ = _edges(faces)
    edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    surplus = np.bincount(index, weights=np.where(edges[:, 0] < edges[:, 1], 1, -1))
    return edges[surplus[index] != 0]
