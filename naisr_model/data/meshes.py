"""Reading surface meshes, repairing small faults and turning down what is not the surface of a body.

Coordinates are taken as millimetres whatever the format says.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, NamedTuple

import igl
import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from naisr_model.data.remarks import Remark
from naisr_model.errors import InputError

READERS = {".stl", ".ply", ".obj", ".vtk", ".vtp", ".glb"}
"""The file endings that :func:`read_mesh` knows."""

OPEN_SHARE = 0.1
"""Largest |sum of area vectors| / area: 0 for a closed surface, 0.5 for a cup, 1 for a plane."""

FLAT_SHARE = 1e-3
"""Smallest volume, as a share of that of the sphere with the same area."""


def read_mesh(path: str | Path) -> trimesh.Trimesh:
    """Read one triangle mesh; polygons are triangulated, nothing else is changed.

    Args:
        path: an STL, PLY, OBJ, VTK, VTP or GLB file; coordinates in millimetres.

    Raises:
        InputError: when the file is missing, of another kind, unreadable, without faces, or has a
            coordinate that is not finite or a face whose vertices are missing.
    """
    mesh = read_mesh_or_points(path)
    if not len(mesh.faces):
        raise InputError(f"{Path(path).name} has no faces; it is empty, damaged or a point cloud")
    return mesh


def read_mesh_or_points(path: str | Path) -> trimesh.Trimesh:
    """As :func:`read_mesh`, but a file of points alone gives a mesh without faces.

    Raises:
        InputError: as :func:`read_mesh`, and when there are no points either.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path} does not exist; correct the path")
    suffix = path.suffix.lower()
    if suffix not in READERS:
        raise InputError(f"{path.name} is not one of {', '.join(sorted(READERS))}; convert it first")
    try:
        vertices, faces = _OTHER_READERS.get(suffix, _read_with_vtk)(path)
    except InputError:
        raise
    except Exception as error:  # the readers raise whatever they like on damaged files
        raise InputError(f"{path.name} cannot be read ({error}); export it again") from error
    if not len(vertices):
        raise InputError(f"{path.name} has no faces and no points; it is empty or damaged, export it again")
    if not np.isfinite(vertices).all():
        raise InputError(f"{path.name} has vertices that are not finite numbers; export it again")
    _check_indices(path, faces, len(vertices))
    return trimesh.Trimesh(vertices, faces, process=False)


def _check_indices(path: Path, indices: NDArray[np.int64], vertices: int) -> None:
    if len(indices) and not 0 <= indices.min() <= indices.max() < vertices:
        raise InputError(f"{path.name} has faces that name missing vertices; export it again")


def _read_with_trimesh(path: Path) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    scene = trimesh.load_scene(path, process=False)
    clouds = [part for part in scene.dump() if isinstance(part, trimesh.PointCloud)]
    if clouds and len(clouds) == len(scene.geometry):
        return np.concatenate([np.asarray(cloud.vertices, np.float64) for cloud in clouds]), _NO_FACES
    mesh = scene.to_mesh()
    return np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64)


def _read_ply(path: Path) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """VTK's reader of this format can end the whole process on a file that was cut off."""
    vertices, faces = _read_with_trimesh(path)
    with path.open("rb") as file:
        announced = re.search(rb"^element face (\d+)", file.read(_PLY_HEADER_BYTES), re.MULTILINE)
    if announced is not None and 0 < len(faces) < int(announced[1]):
        raise InputError(f"{path.name} is cut off; copy or export it again")
    return vertices, faces


_PLY_HEADER_BYTES = 65536
_NO_FACES = np.zeros((0, 3), np.int64)
_OTHER_READERS = {".glb": _read_with_trimesh, ".ply": _read_ply}


def _read_with_vtk(path: Path) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    import pyvista

    with pyvista.vtk_verbosity("off"):
        data = pyvista.read(path)
    if isinstance(data, pyvista.Grid):
        raise InputError(f"{path.name} holds a grid of voxels; give a surface, or labels as NIfTI or NRRD")
    # Checked before the filters, which would read whatever lies beyond the points.
    _check_indices(path, _point_indices(data), data.n_points)
    if not isinstance(data, pyvista.PolyData):
        data = data.extract_surface()
    data = data.triangulate()
    return np.asarray(data.points, np.float64), np.asarray(data.regular_faces, np.int64)


def _point_indices(data: Any) -> NDArray[np.int64]:
    """Every point that a cell of the data set names; none for a grid, whose cells are implied."""
    import pyvista

    getters = (getattr(data, f"Get{kind}", None) for kind in ("Verts", "Lines", "Polys", "Strips", "Cells"))
    arrays = [pyvista.convert_array(get().GetConnectivityArray()) for get in getters if get is not None]
    return np.concatenate([np.zeros(0, np.int64), *arrays])


def repair_mesh(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Clean a mesh as :func:`cleaned` does and turn its faces outward as :func:`faced_outward` does."""
    return faced_outward(cleaned(mesh))


def cleaned(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Merge duplicated vertices, drop degenerate and repeated faces, and wind neighbours alike."""
    mesh = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    mesh.update_faces(mesh.nondegenerate_faces(height=0.0) & mesh.unique_faces())
    mesh.remove_unreferenced_vertices()
    if not len(mesh.faces):
        return mesh
    if mesh.is_winding_consistent:
        return mesh
    faces, _ = igl.bfs_orient(np.asarray(mesh.faces, np.int64))
    return trimesh.Trimesh(mesh.vertices, faces, process=False)


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
        What is odd but bearable: open edges, several components.

    Raises:
        InputError: when there are no faces, or the surface is flat or open.
    """
    if not len(mesh.faces):
        raise InputError("the mesh has no faces; check how it was exported")
    vertices, faces = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64)
    bulk = _bulk(vertices, faces, np.zeros(len(faces), dtype=np.int64))
    if bulk.opening[0] > OPEN_SHARE:
        raise InputError(
            f"the surface is open (opening {100 * bulk.opening[0]:.0f} % of its area); close its holes"
        )
    if bulk.volume[0] < FLAT_SHARE * bulk.area[0] ** 1.5 / (6 * np.sqrt(np.pi)):
        raise InputError("the surface encloses no volume; it must bound a body")
    return _oddities(faces)


def _oddities(faces: NDArray[np.int64]) -> tuple[Remark, ...]:
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, uses = np.unique(edges, axis=0, return_counts=True)
    open_edges, components = int((uses == 1).sum()), igl.facet_components(faces)[0]
    found = (
        (Remark("look", "open", f"{open_edges} open edges"), open_edges > 0),
        (Remark("look", "components", f"{components} components"), components > 1),
    )
    return tuple(remark for remark, applies in found if applies)


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
    edges = np.asarray(mesh.faces, np.int64)[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    keys = edges.min(axis=1) * len(mesh.vertices) + edges.max(axis=1)
    _, index = np.unique(keys, return_inverse=True)
    surplus = np.bincount(index, weights=np.where(edges[:, 0] < edges[:, 1], 1, -1))
    return edges[surplus[index] != 0]
