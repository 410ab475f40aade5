"""A patient's file brought into the frame of an atlas: read, repaired, aligned and checked.

:func:`take_in` does all of it; a window goes step by step: :func:`labels` says what there is to choose from,
:func:`read` gives an :class:`Intake` with its sentences and remarks, :func:`aligned` moves it and shows the
proposal, and what ``is_ready`` can be fitted.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from naisr_model.atlas import Atlas
from naisr_model.covariates import Values
from naisr_model.data import curves, volumes
from naisr_model.data.align import (
    Landmarks,
    Method,
    Proposal,
    propose,
    read_landmarks,
)
from naisr_model.data.markups import Space
from naisr_model.data.patients import (
    PatientShape,
    check_patient,
    moved,
    read_patient,
    repaired,
    scaled,
)
from naisr_model.data.remarks import Remark, gravest_first
from naisr_model.errors import InputError
from naisr_model.frames import SPACE, Extent
from naisr_model.numerals import LARGEST
from naisr_model.progress import SILENT, Progress
from naisr_model.shapes.kinds import Shape

ASTRAY_POINTS, ASTRAY_PLACES = 200, 12
"""On how many points, and at how many places along the first covariate, a scan's distance is judged."""

ASTRAY_SHARE = 0.02
"""Of the atlas's unit of length: a scan farther from every average shape does not lie as they do. Airways and
bodies in place are up to 0.013 away, an airway shifted by 10 mm 0.024."""


WORSE = 1.1
"""From so many times the distance before it on, an alignment has made it worse."""


@dataclass(frozen=True, eq=False)
class Intake:
    """A patient's shape on its way to a fit, and what was done so far.

    Attributes:
        patient: as it lies now, in the frame of the atlas once nothing in ``found`` refuses it.
            An open surface or a cloud of points (``not patient.is_closed``) is fitted as a part: it has
            no volume of its own, says nothing of inside and outside, and is aligned by its own points
            alone, so that an alignment of it deserves a closer look.
        found: what is the matter as it lies, gravest first; all that refuses it is to lie far from the atlas,
            which an alignment mends, or a unit that a person has to choose.
        method: of the alignment: none, icp or landmarks.
        proposal: the motion that was made; None without alignment.
        relaid_mm: how far, on average, its points were then moved onto the fit.
        extent: what the atlas's shapes enclose, and its unit.
    """

    patient: PatientShape
    found: tuple[Remark, ...]
    method: Method = "none"
    proposal: Proposal | None = None
    relaid_mm: float = 0.0
    extent: Extent = SPACE

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """What is odd about the file, what was repaired and what is left, gravest first."""
        doubt = () if self.proposal is None else _doubt(self.proposal, self.method)
        return gravest_first((*self.patient.remarks, *doubt, *self.found))

    @property
    def is_ready(self) -> bool:
        """Whether a fit makes sense."""
        return all(remark.severity != "refuse" for remark in self.found)

    @property
    def alignment(self) -> str:
        """How it was moved to the atlas, a sentence; empty where it was not."""
        if self.proposal is None:
            return ""
        farther = f"; then moved by {self.relaid_mm:.2f} mm onto its own fit" if self.relaid_mm else ""
        return _told(self.method, self.proposal) + farther

    @property
    def own_extent(self) -> float | None:
        """What the patient's own shape encloses; None where it is open or a cloud of points."""
        return self.extent.of(self.patient.mesh_mm) if self.patient.is_closed else None

    @property
    def sentences(self) -> tuple[str, ...]:
        """All of it for people: what was read, the remarks and how grave they are, alignment, volume."""
        aligned = (self.alignment,) if self.alignment else ()
        own = self.own_extent
        measured = () if own is None else (f"its own {self.extent.title} is {self.extent.told(own, 2)}",)
        remarks = (f"{remark.severity}: {remark.text}" for remark in self.remarks)
        return (f"read {self.patient.source}", *remarks, *aligned, *measured)

    def to_json(self) -> dict[str, Any]:
        """The same for programs; the matrix leads from the file's coordinates to the atlas frame."""
        return {
            "source": self.patient.source,
            self.extent.key(): self.own_extent,
            "remarks": [remark.to_json() for remark in self.remarks],
            "alignment": None if self.proposal is None else _distances(self),
            "file_to_atlas": self.patient.from_file.tolist(),
        }


def take_in(
    path: Path,
    atlas: Atlas,
    known: Values,
    *,
    label: int | str | None = None,
    scale: float | None = None,
    align: Method = "none",
    landmarks: Path | None = None,
    progress: Progress = SILENT,
) -> Intake:
    """Read a patient's file and bring it into the frame of an atlas: :func:`read`, then :func:`aligned`.

    Args:
        path: a mesh, whole or in part, a label volume or a cloud of points.
        atlas: whose frame and shape count.
        known: covariates in real units; the patient is aligned to the atlas's shape at them.
        label: which label of a volume, its number or its name.
        scale: millimetres per unit of the file; left out, it is guessed where the size is implausible.
        align: ``none``, ``icp`` or ``landmarks``.
        landmarks: a CSV name,x,y,z in the coordinates of the file, or one of 3D Slicer; for ``landmarks``.
        progress: told the share of the alignment: the atlas's shape is made, the motion is sought.

    Raises:
        InputError: when the file cannot be read or aligned, or what is wrong with it cannot be repaired.
        Cancelled: when nobody waits any more.
    """
    intake = aligned(read(path, atlas, label, scale), atlas, known, align, landmarks, progress)
    _refuse(path.name, intake.found)
    progress.tell(1.0)
    return intake


def labels(path: str | Path, dim: int = 3) -> dict[int | str, str] | None:
    """What :func:`read` may be asked for: of a label volume its labels, each with its name and size.

    Args:
        path: the file.
        dim: 2 for an atlas of curves, whose labels are in images.

    Returns:
        A title by label, as ``{2: "2 'airway': 41.9 cm³"}``, empty where every voxel is 0; None of a file
        that is no label volume. Labels of layers that overlap may share a number and go by their names.

    Raises:
        InputError: when a label volume cannot be used.
    """
    if dim == 2:
        return dict(curves.labels_in(Path(path)).items()) if curves.is_image(Path(path)) else None
    if not volumes.is_label_volume(path):
        return None
    return volumes.titles(Path(path).name, volumes.read_labels(path))


def require_label(path: str | Path, label: int | str | None, dim: int = 3) -> None:
    """Make sure that it is clear what :func:`read` reads of a label volume; other files are left alone.

    Args:
        path: the file.
        label: which label was chosen.
        dim: 2 for an atlas of curves, whose labels are in images.

    Raises:
        InputError: naming the labels, when it is not, or when the volume cannot be used.
    """
    if dim == 2:
        if curves.is_image(Path(path)):
            curves.sound_curve(path, label)
    elif volumes.is_label_volume(path):
        volumes.choose(Path(path).name, volumes.read_labels(path), label)


def read(path: Path, atlas: Atlas, label: int | str | None = None, scale: float | None = None) -> Intake:
    """Read a patient's file, repair what can be repaired and find what is still the matter.

    Args:
        path: a mesh, whole or in part, a label volume or a cloud of points.
        atlas: whose frame tells what is a plausible size and place.
        label: which label of a volume, its number or its name; see :func:`labels`.
        scale: millimetres per unit of the file; left out, it is guessed where the size is implausible.

    Raises:
        InputError: when the file cannot be read, or cannot be used whatever its unit and place.
    """
    read_as = read_patient(path, label, atlas.frame.dim)
    patient = repaired(_in_units(read_as, scale), atlas.frame)
    found = _found(patient, atlas)
    _refuse(path.name, (remark for remark in found if remark.topic not in ("far", "units")))
    return Intake(patient, found, extent=atlas.extent)


def aligned(
    intake: Intake,
    atlas: Atlas,
    known: Values,
    method: Method,
    landmarks: Path | None = None,
    progress: Progress = SILENT,
) -> Intake:
    """The patient moved onto the atlas's shape; who declines the proposal keeps ``intake``.

    Args:
        intake: from :func:`read`; it is not changed.
        atlas: whose shape counts.
        known: covariates in real units; the patient is aligned to the atlas's shape at them.
        method: ``icp``, ``landmarks``, or ``none`` to leave everything as it is.
        landmarks: a CSV name,x,y,z in the coordinates of the file, or one of 3D Slicer; for ``landmarks``.
        progress: told the share of the alignment: the atlas's shape is made, the motion is sought.

    Raises:
        InputError: when landmarks are missing or too few, no shape is there to align to, or the unit is open.
        Cancelled: when nobody waits any more.
    """
    points = _landmarks(method, landmarks, intake.patient.space or "LPS")
    if method == "none":
        return intake
    if atlas.frame.dim == 2:
        raise InputError(
            "curves are fitted where they lie; leave out --align and give them in the atlas's frame"
        )
    _refuse(intake.patient.source, (remark for remark in intake.found if remark.topic == "units"))
    proposal = _proposal(intake.patient, atlas, known, method, points, progress)
    patient = moved(intake.patient, proposal.transform)
    return Intake(patient, _found(patient, atlas), method, proposal, extent=atlas.extent)


def relaid(intake: Intake, atlas: Atlas, motion_mm: NDArray[np.float64]) -> Intake:
    """A patient that was aligned, moved farther by a rigid motion ``[4, 4]``, as its fit asks for."""
    patient = moved(intake.patient, motion_mm)
    before, after = (np.asarray(each.mesh_mm.vertices) for each in (intake.patient, patient))
    farther_mm = intake.relaid_mm + float(np.linalg.norm(after - before, axis=1).mean())
    return replace(intake, patient=patient, found=_found(patient, atlas), relaid_mm=farther_mm)


def _found(patient: PatientShape, atlas: Atlas) -> tuple[Remark, ...]:
    """What is the matter with a patient as it lies."""
    found = check_patient(patient, atlas.frame)
    if any(remark.severity == "refuse" for remark in found):
        return found
    away_mm = _away_mm(patient.mesh_mm, atlas)
    if away_mm <= ASTRAY_SHARE * atlas.frame.scale_mm:
        return found
    away = atlas.frame.length(away_mm, 0)
    sentence = f"the shape is {away} from the nearest of the atlas's average shapes on average"
    remedy = "align it to the atlas (icp or landmarks) before it is fitted, or check that it is such a shape"
    if atlas.frame.dim == 2:
        remedy = "look whether it lies as they do, and whether it is such a shape"
    return gravest_first((*found, Remark("look", "astray", sentence, remedy)))


def _away_mm(mesh_mm: Shape, atlas: Atlas) -> float:
    """Mean distance of points of a shape to the nearest of some average shapes along the population."""
    vertices_mm = np.asarray(mesh_mm.vertices, np.float64)
    points_mm = vertices_mm[np.random.default_rng(0).permutation(len(vertices_mm))[:ASTRAY_POINTS]]
    rows = np.flatnonzero(~atlas.population.held_out)
    order = rows[np.argsort(atlas.population.values[rows, :1].sum(axis=1), kind="stable")]
    places = order[np.linspace(0, len(order) - 1, ASTRAY_PLACES).round().astype(int)]
    return min(
        float(np.abs(atlas.sdf(points_mm, atlas.population.row(place), extrapolate=True)).mean())
        for place in dict.fromkeys(places.tolist())
    )


def _landmarks(align: Method, path: Path | None, space: Space) -> Landmarks:
    if (align == "landmarks") != (path is not None):
        raise InputError(
            "alignment by landmarks and a file of them (--align landmarks, --landmarks FILE.csv) need each "
            "other; give both or neither"
        )
    return {} if path is None else read_landmarks(path, space)


def _in_units(patient: PatientShape, scale: float | None) -> PatientShape:
    if scale is None:
        return patient
    if not 0 < scale <= LARGEST:
        raise InputError(f"the scale is {scale:g}; give the millimetres per unit of the file, as 1000")
    return replace(scaled(patient, scale / patient.unit_mm), units_known=True)


def _refuse(name: str, remarks: Iterable[Remark]) -> None:
    for remark in remarks:
        if remark.severity == "refuse":
            raise InputError(f"{name}: {remark.text}")


def _proposal(
    patient: PatientShape,
    atlas: Atlas,
    known: Values,
    align: Method,
    landmarks: Landmarks,
    progress: Progress,
) -> Proposal:
    reference_mm = atlas.shape(known, progress=progress.part(0.0, 0.3))
    if not len(reference_mm.faces):
        raise InputError("there is no surface at these covariates to align to; give others as known")
    carried = {name: _moved_point(patient, point) for name, point in landmarks.items()}
    alignment = atlas.checkpoint.alignment
    return propose(align, patient.mesh_mm, reference_mm, alignment, carried, progress.part(0.3, 1.0))


def _moved_point(patient: PatientShape, point: tuple[float, float, float]) -> tuple[float, float, float]:
    x, y, z = (patient.from_file @ np.array([*point, 1.0]))[:3].tolist()
    return x, y, z


def _distances(intake: Intake) -> dict[str, Any]:
    assert intake.proposal is not None
    numbers = {name: value for name, value in asdict(intake.proposal).items() if name != "transform"}
    return {"method": intake.method, **numbers, "relaid_mm": intake.relaid_mm}


def _told(method: Method, proposal: Proposal) -> str:
    away = "" if proposal.landmarks_mm is None else f", landmarks {proposal.landmarks_mm:.2f} mm apart"
    ends = f"{proposal.before_mm:.2f} mm before, {proposal.after_mm:.2f} mm after"
    turn = f"turned by {proposal.turned_deg:.0f}°"
    return f"aligned by {method}, {turn}; mean distance to the atlas's shape {ends}{away}"


def _doubt(proposal: Proposal, method: Method) -> Iterator[Remark]:
    if proposal.after_mm > WORSE * proposal.before_mm:
        ends = f"{proposal.before_mm:.1f} mm before, {proposal.after_mm:.1f} mm after"
        remedy = (
            "see whether the landmarks are of this scan" if method == "landmarks" else "leave it as it was"
        )
        yield Remark("look", "worse", f"the alignment made it worse: {ends}", remedy)
    if proposal.rival_deg is not None:
        other = f"the shape turned by another {proposal.rival_deg:.0f}° fits nearly as well"
        yield Remark("look", "rival", other, "see whether it is upright, or align it by landmarks")
