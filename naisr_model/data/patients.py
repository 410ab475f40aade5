"""One patient's shape: reading it from any file, finding what is wrong with it, and setting that right.

:func:`read_patient`, then :func:`repaired`, whose result remembers what was done; :func:`check_patient` says
what is left.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
import trimesh
from numpy.typing import ArrayLike, NDArray

from naisr_model.data import curves, formats, meshes, sound, volumes
from naisr_model.data.points import POINT_ENDINGS, read_points
from naisr_model.data.remarks import Remark, gravest_first
from naisr_model.errors import InputError
from naisr_model.files import require_file
from naisr_model.frames import BOX_MARGIN, UNITS_MM, Frame
from naisr_model.numerals import LARGEST
from naisr_model.shapes.kinds import Shape

MOST_FACES = 500_000
"""A surface with more is decimated; a shape's detail at the networks' resolution needs far fewer."""

FEWEST_POINTS = 50

PLAUSIBLE_SIZE = (0.15, 1.3)
"""Longest side of a shape over that of the population's largest: from a newborn, or a piece, up."""

_FLAT = 1e-4


@dataclass(frozen=True, eq=False)
class PatientShape:
    """A shape in the world frame of its scan.

    Attributes:
        mesh_mm: the surface in millimetres, neighbouring faces wound alike; without faces it is a
            cloud of points. A label volume gives LPS coordinates; of a mesh or a cloud they are as
            in the file. For an atlas in the plane it is a curve.
        source: what was read, for example ``p01.nii.gz, label 2 'airway'``.
        space: ``LPS`` or ``RAS`` where the file says it, else empty.
        remarks: what was odd about the file, and what was repaired.
        from_file: ``[dim + 1, dim + 1]``, coordinates as they were read to those of ``mesh_mm``, by every
            repair and motion since; landmarks of the file go the same way.
        unit_mm: how long a unit of the file is.
        is_unit_stated: whether the file says so itself, so that no guess overrules it.
        units_known: whether a person said how long a unit is, so that it is not guessed.
    """

    mesh_mm: Shape
    source: str = ""
    space: Literal["LPS", "RAS", ""] = ""
    remarks: tuple[Remark, ...] = ()
    from_file: NDArray[np.float64] = field(default_factory=lambda: np.eye(4))
    unit_mm: float = 1.0
    is_unit_stated: bool = False
    units_known: bool = False

    @property
    def is_cloud(self) -> bool:
        """Whether there are points alone."""
        return not len(self.mesh_mm.faces)

    @property
    def is_closed(self) -> bool:
        """Whether the surface bounds a body, so that its volume means something."""
        return sound.is_closed(self.mesh_mm)

    @property
    def volume_cm3(self) -> float | None:
        """What a surface encloses; None where it is open, a cloud of points or a curve."""
        return float(self.mesh_mm.volume) / 1000 if self.is_closed and self.dim == 3 else None

    @property
    def dim(self) -> int:
        """2 of a curve in the plane, 3 of a surface."""
        return int(np.shape(self.mesh_mm.vertices)[1])


# --- reading ------------------------------------------------------------------------------------


def read_patient(path: str | Path, label: int | str | None = None, dim: int = 3) -> PatientShape:
    """Read a mesh, a label volume or a cloud of points; of shapes in the plane a curve.

    Args:
        path: STL, PLY, OBJ, VTK, VTP or GLB; a label volume; or text of points (CSV, TXT, XYZ) with
            columns x, y, z. A curve as :func:`~.curves.sound_curve` takes it.
        label: which label of a volume, its number or its name; may be left out where there is only one.
        dim: 2 for a curve in the plane.

    Raises:
        InputError: when the file cannot be used, or a volume has several labels and none is chosen.
    """
    path = require_file(path)
    if dim == 2:
        return _from_curve(path, label)
    if volumes.is_label_volume(path):
        return _from_labels(path, label)
    if label is not None:
        raise InputError(f"{path.name} is no label volume, so label {label} cannot be chosen; leave it out")
    if path.suffix.lower() in POINT_ENDINGS and not _holds_mesh(path):
        points = read_points(path)
        return PatientShape(_cloud(points), f"{path.name}, {len(points):,} points")
    return _from_mesh(path)


def _holds_mesh(path: Path) -> bool:
    """Whether a file that is called a text of points is a mesh all the same."""
    return bool(formats.format_of(formats.plain(formats.content_of(path)), path.suffix.lower()[1:]))


def _from_mesh(path: Path) -> PatientShape:
    file = meshes.read_file(path, {*POINT_ENDINGS, *volumes.ENDINGS})
    mesh, remarks = file.mesh_mm, file.remarks
    kind = f"{len(mesh.faces):,} faces" if len(mesh.faces) else f"{len(mesh.vertices):,} points"
    # Beyond that, mending takes a minute, and decimation cleans as well.
    if 0 < len(mesh.faces) <= MOST_FACES:
        try:
            mesh, mended = meshes.mended_mesh(mesh)
        except InputError as error:
            raise InputError(f"{path.name}: {error}") from error
        remarks = (*remarks, *mended)
    unit_mm = float(np.linalg.norm(file.from_file[:3, 0]))
    return PatientShape(mesh, f"{path.name}, {kind}", file.space, remarks, file.from_file, unit_mm)


def _from_curve(path: Path, label: int | str | None) -> PatientShape:
    if not curves.is_curve_file(path):
        raise InputError(
            f"{path.name} holds no curve in the plane; give one as SVG, CSV x,y or a label image"
        )
    file = curves.sound_curve(path, label)
    unit_mm = file.unit_mm or 1.0
    return PatientShape(
        file.curve,
        f"{path.name}, a curve of {len(file.curve.faces):,} segments",
        remarks=file.remarks,
        from_file=np.diag([unit_mm, unit_mm, 1.0]),
        unit_mm=unit_mm,
        is_unit_stated=file.unit_mm is not None,
    )


def _cloud(points: NDArray[np.float64]) -> trimesh.Trimesh:
    return trimesh.Trimesh(points, np.zeros((0, 3), np.int64), process=False)


def _from_labels(path: Path, label: int | str | None) -> PatientShape:
    volume, chosen = volumes.choose(path.name, volumes.read_labels(path), label)
    surface = volumes.label_surface(volume, chosen)
    remarks = (*volume.remarks, *volumes.label_remarks(volume, chosen, surface))
    return PatientShape(
        surface,
        f"{path.name}, label {volumes.titled(volume, chosen)}",
        "LPS",
        remarks,
        unit_mm=volume.unit_mm or 1.0,
        is_unit_stated=volume.unit_mm is not None,
    )


# --- checking -----------------------------------------------------------------------------------


class _Fault(NamedTuple):
    """A remark, what would set the matter right, and what is said once that is done."""

    remark: Remark
    repair: Callable[[PatientShape], PatientShape] | None = None
    done: str = ""


def check_patient(patient: PatientShape, frame: Frame) -> tuple[Remark, ...]:
    """Find what would spoil a fit, what forbids one first.

    The position is judged too, so a scan is checked again after it was aligned.

    Args:
        patient: what was read.
        frame: that of the atlas; its box tells where the population's shapes lie and how large they are.
    """
    return gravest_first(fault.remark for fault in _faults(patient, frame))


def repaired(patient: PatientShape, frame: Frame) -> PatientShape:
    """Set right what forbids a fit, where the program can; the result's remarks tell what was done."""
    done: set[str] = set()
    while fault := next(_mendable(patient, frame, done), None):
        assert fault.repair is not None
        told = Remark("fine", fault.remark.topic, fault.done)
        patient = fault.repair(patient)
        patient = replace(patient, remarks=(*patient.remarks, told))
        done.add(told.topic)
    return patient


def _mendable(patient: PatientShape, frame: Frame, done: Container[str]) -> Iterator[_Fault]:
    for fault in _faults(patient, frame):
        if fault.remark.severity == "refuse" and fault.repair and fault.remark.topic not in done:
            yield fault


def _faults(patient: PatientShape, frame: Frame) -> list[_Fault]:
    if fatal := _unusable(patient):
        return [_Fault(fatal)]
    if patient.dim == 2:  # what a curve has of its own was looked at as it was read
        points = np.asarray(patient.mesh_mm.vertices)
        units = _units(patient, points, frame)
        return [fault for fault in (units, _unmended(_position(points, frame))) if fault]
    far = meshes.far_points(patient.mesh_mm)
    main_mm = np.asarray(patient.mesh_mm.vertices, np.float64)[~far]
    units = _units(patient, main_mm, frame)
    position = None if units and units.remark.severity == "refuse" else _position(main_mm, frame)
    found = [units, *map(_unmended, (position, _voxel_indices(patient), _space(patient)))]
    found.append(_unmended(meshes.debris(patient.mesh_mm, far)))
    if len(patient.mesh_mm.faces) > MOST_FACES:
        found.append(_too_fine(patient))
    elif not patient.is_cloud:
        seen = (meshes.components(patient.mesh_mm), meshes.spikes(patient.mesh_mm), _opening(patient))
        found += [_inverted(patient), *map(_unmended, seen)]
    return [fault for fault in found if fault]


def _unmended(remark: Remark | None) -> _Fault | None:
    return None if remark is None else _Fault(remark)


def _unusable(patient: PatientShape) -> Remark | None:
    points = np.asarray(patient.mesh_mm.vertices)
    if len(points) < FEWEST_POINTS:
        sentence = f"the shape has only {len(points)} points" if len(points) else "the shape is empty"
        return Remark("refuse", "empty", sentence, "export the surface again")
    if not np.isfinite(points).all():
        return Remark("refuse", "numbers", "some coordinates are not finite numbers", "export it again")
    if (largest := np.abs(points).max()) > LARGEST:
        sentence = f"the shape has coordinates up to {largest:.3g} mm"
        return Remark("refuse", "numbers", sentence, "check its unit (--scale), or export it again")
    if _is_flat(patient):
        return Remark("refuse", "flat", "the shape is flat and bounds no body", "check how it was exported")
    return None


def _is_flat(patient: PatientShape) -> bool:
    points = np.asarray(patient.mesh_mm.vertices)
    spread = np.sqrt(np.maximum(np.linalg.eigvalsh(np.cov(points.T)), 0))
    if spread[0] <= _FLAT * spread[-1]:
        return True
    if len(patient.mesh_mm.faces) > MOST_FACES or not patient.is_closed or patient.dim == 2:
        return False
    area, volume = float(patient.mesh_mm.area), abs(_volume_from_middle(patient.mesh_mm))
    return volume < meshes.FLAT_SHARE * area**1.5 / (6 * np.sqrt(np.pi))


def _units(patient: PatientShape, main_mm: NDArray[np.float64], frame: Frame) -> _Fault | None:
    """Judged by the points of the main piece."""
    largest_mm = 2 * frame.scale_mm / BOX_MARGIN
    longest = float(np.ptp(main_mm, axis=0).max())
    low, high = PLAUSIBLE_SIZE
    if low <= longest / largest_mm <= high:
        return None
    stated = "by the unit that the file states, " if patient.is_unit_stated else ""
    usual = f"the atlas's shapes are up to {frame.length(largest_mm, 0)}"
    sentence = f"{stated}the shape is {longest:.3g} {frame.unit} long, {usual}"
    units = {} if patient.units_known or frame.unit != "mm" else UNITS_MM
    fits = {
        unit: mm for unit, mm in units.items() if low <= longest * mm / patient.unit_mm / largest_mm <= high
    }
    if fits:
        return _guessed(fits, sentence, patient.unit_mm, alone=not stated)
    # Of known units, a short shape may be a small part; nothing makes a long one right.
    part = patient.units_known and longest < low * largest_mm
    unit = (
        "millimetres (Unit in the window, else --scale)" if frame.unit == "mm" else f"{frame.unit} (--scale)"
    )
    remedy = f"scale it to {unit}, or check that it is this anatomy"
    return _Fault(Remark("look" if part else "refuse", "units", sentence, remedy))


def _guessed(fits: Mapping[str, float], sentence: str, unit_mm: float, *, alone: bool) -> _Fault:
    """One unit that alone explains the size is taken; among several a person has to choose."""
    guess = f"{sentence}, so its numbers look like {' or '.join(fits)}"
    if len(fits) > 1 or not alone:
        choices = " or ".join(f"--scale {mm:g} for {unit}" for unit, mm in fits.items())
        return _Fault(Remark("refuse", "units", guess, f"say which they are (Unit in the window): {choices}"))
    (mm,) = fits.values()
    done = f"{guess}: it was scaled by {mm / unit_mm:g}"
    return _Fault(
        Remark("refuse", "units", guess, f"scale it by {mm / unit_mm:g}"),
        partial(scaled, factor=mm / unit_mm),
        done,
    )


def _voxel_indices(patient: PatientShape) -> Remark | None:
    doubled = 2 * np.asarray(patient.mesh_mm.vertices)
    if np.abs(doubled - np.round(doubled)).max() > 1e-6:
        return None
    sentence = "all coordinates are whole or half numbers, so they look like voxel indices"
    return Remark(
        "look", "voxels", sentence, "if they are, give the voxel size in mm (--scale on the command line)"
    )


_ALIGN = "align it to the atlas (icp or landmarks)"


def _position(main_mm: NDArray[np.float64], frame: Frame) -> Remark | None:
    points = frame.to_model(main_mm)
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    remedy = _ALIGN if frame.dim == 3 else "give it in the frame of the atlas's shapes"
    if np.abs(centre).max() > 1:
        away_mm = float(np.linalg.norm(centre)) * frame.scale_mm
        sentence = f"the shape lies {frame.length(away_mm, 0)} from the middle of the atlas, outside its box"
        return Remark("refuse", "far", sentence, remedy)
    outside = float((np.abs(points).max(axis=1) > 1).mean())
    if not outside:
        return None
    return Remark(
        "look", "outside", f"{100 * outside:.0f} % of the shape lies outside the atlas's box", remedy
    )


def _space(patient: PatientShape) -> Remark | None:
    if patient.space != "RAS":
        return None
    sentence = "the file says that its coordinates are RAS, while label volumes are read as LPS"
    return Remark("look", "space", sentence, "if it lies turned by half about z, align it (icp or landmarks)")


def _too_fine(patient: PatientShape) -> _Fault:
    sentence = f"the surface has {len(patient.mesh_mm.faces):,} faces, more than a fit can use"
    few = f"{MOST_FACES // 2:,}"
    remark = Remark("refuse", "fine", sentence, f"thin it to about {few}")
    return _Fault(remark, _thinned, f"{sentence}: it was thinned to about {few}")


def _inverted(patient: PatientShape) -> _Fault | None:
    turned = _outward(patient.mesh_mm)
    share = float((np.asarray(turned.faces) != patient.mesh_mm.faces).any(axis=1).mean())
    if not share:
        return None
    looked = f"{100 * share:.0f} % of the faces look inward, so the volume is wrong or negative"
    remark = Remark("refuse", "inverted", looked, "turn them round")
    return _Fault(remark, flipped, f"{100 * share:.0f} % of the faces looked inward: they were turned round")


def _outward(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Closed components by their volume; an open surface as a whole, seen from its middle."""
    turned = meshes.faced_outward(mesh)
    if _volume_from_middle(turned) >= 0:
        return turned
    return trimesh.Trimesh(turned.vertices, turned.faces[:, ::-1], process=False)


def _volume_from_middle(mesh: trimesh.Trimesh) -> float:
    """Signed volume of the cone over a surface from its middle, in mm3."""
    heights = mesh.triangles_center - mesh.triangles_center.mean(axis=0)
    return float(np.einsum("ij,ij", heights, mesh.triangles_cross)) / 6


def _opening(patient: PatientShape) -> Remark | None:
    remark = meshes.opening(patient.mesh_mm)
    if remark is None or remark.severity == "fine":
        return remark
    remedy = "close it if the shape is whole; else it is fitted as a part, and the volume is the model's"
    return replace(remark, remedy=remedy)


# --- repairing ----------------------------------------------------------------------------------


def moved(patient: PatientShape, transform: NDArray[np.float64]) -> PatientShape:
    """The patient after a matrix ``[dim + 1, dim + 1]``, such as that of an accepted alignment."""
    mesh = patient.mesh_mm.copy()
    mesh.apply_transform(transform)
    return replace(patient, mesh_mm=mesh, from_file=transform @ patient.from_file)


def scaled(patient: PatientShape, factor: ArrayLike) -> PatientShape:
    """Coordinates times ``factor``: one number, or one an axis for voxels that are no cubes."""
    return moved(patient, np.diag([*np.broadcast_to(np.asarray(factor, float), patient.dim), 1.0]))


def flipped(patient: PatientShape) -> PatientShape:
    """Faces that look inward turned round."""
    return replace(patient, mesh_mm=_outward(patient.mesh_mm))


def decimated(patient: PatientShape, faces: int = MOST_FACES // 2) -> PatientShape:
    """About ``faces`` faces, by merging the vertices in each cell of a lattice.

    With quadrics, 300,000 faces take 15 s on one core; this takes 0.3 s, and the error is a small
    part of the cell's side, sqrt(2 area / faces).
    """
    import pyvista
    from vtkmodules.vtkFiltersCore import vtkBinnedDecimation

    mesh = patient.mesh_mm
    side_mm = np.sqrt(2 * _area_mm2(mesh) / faces)
    binning = vtkBinnedDecimation()
    binning.SetInputData(pyvista.PolyData.from_regular_faces(mesh.vertices, mesh.faces))
    binning.AutoAdjustNumberOfDivisionsOff()
    binning.SetNumberOfDivisions(*(int(n) for n in np.ceil(mesh.extents / side_mm) + 1))
    binning.Update()
    coarse = pyvista.wrap(binning.GetOutput())
    vertices, triangles = np.asarray(coarse.points, np.float64), np.asarray(coarse.regular_faces, np.int64)
    unfolded = trimesh.Trimesh(vertices, _without_folds(triangles), process=False)
    unfolded.remove_unreferenced_vertices()
    return replace(patient, mesh_mm=unfolded)


def _thinned(patient: PatientShape) -> PatientShape:
    """Decimated, and mended as smaller surfaces are when they are read."""
    thin = decimated(patient)
    mesh, mended = meshes.mended_mesh(thin.mesh_mm)
    return replace(thin, mesh_mm=mesh, remarks=(*thin.remarks, *mended))


def _without_folds(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """Leave out each pair of faces that share their corners and look opposite ways.

    What looks one way twice stays twice, or the surface would be open there.
    """
    order = np.argsort(faces, axis=1)
    turns = np.where(np.linalg.det(np.eye(3)[order]) > 0, 1, -1)
    corners, index = np.unique(np.take_along_axis(faces, order, axis=1), axis=0, return_inverse=True)
    net = np.bincount(index.ravel(), weights=turns).round().astype(np.int64)
    facing = np.where((net > 0)[:, None], corners, corners[:, ::-1])
    return np.repeat(facing, np.abs(net), axis=0)


def _area_mm2(mesh: trimesh.Trimesh) -> float:
    a, b, c = np.asarray(mesh.vertices)[np.asarray(mesh.faces)].transpose(1, 0, 2)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)
