"""A patient's file brought into the frame of an atlas: read, repaired, aligned and checked."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from naisr_model.atlas import Atlas
from naisr_model.covariates import Values
from naisr_model.data.align import Landmarks, Method, Proposal, propose, read_landmarks
from naisr_model.data.patients import (
    Finding,
    Patient,
    check_patient,
    moved,
    read_patient,
    repaired,
    scaled,
)
from naisr_model.errors import InputError

StopCheck = Callable[[], bool]


@dataclass(frozen=True, eq=False)
class Intake:
    """A patient who can be fitted, and what was done on the way.

    Attributes:
        patient: in the frame of the atlas.
        repairs: what was wrong with the file and was set right, a sentence each.
        remarks: what is odd about it and was left, a sentence each.
        method: of the alignment: none, icp or landmarks.
        proposal: the motion that was made; None without alignment.
    """

    patient: Patient
    repairs: tuple[str, ...]
    remarks: tuple[str, ...]
    method: Method
    proposal: Proposal | None

    @property
    def sentences(self) -> tuple[str, ...]:
        """All of it for people, in the order in which it was done."""
        aligned = () if self.proposal is None else (_told(self.method, self.proposal),)
        return (f"read {self.patient.source}", *self.repairs, *aligned, *self.remarks)

    def to_json(self) -> dict[str, Any]:
        """The same for programs; the matrix leads from the file's coordinates to the atlas frame."""
        return {
            "source": self.patient.source,
            "repairs": list(self.repairs),
            "remarks": list(self.remarks),
            "alignment": None if self.proposal is None else _distances(self.method, self.proposal),
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
    should_stop: StopCheck | None = None,
) -> Intake:
    """Read a patient's file and bring it into the frame of an atlas.

    Args:
        path: a mesh, whole or in part, a label volume or a cloud of points.
        atlas: whose frame and shape count.
        known: covariates in real units; the patient is aligned to the atlas's shape at them.
        label: which label of a volume, its number or its name.
        scale: millimetres per unit of the file; left out, it is guessed where the size is implausible.
        align: ``none``, ``icp`` or ``landmarks``.
        landmarks: a CSV name,x,y,z in the coordinates of the file; for ``landmarks``.
        should_stop: polled while the atlas's shape is made.

    Raises:
        InputError: when the file cannot be read or aligned, or what is wrong with it cannot be repaired.
        Cancelled: when ``should_stop()`` turned true.
    """
    points = _landmarks(align, landmarks)
    patient, done, left = repaired(_in_units(read_patient(path, label), scale), atlas.frame)
    _stop_at_errors(path, [finding for finding in left if align == "none" or finding.topic != "far"])
    proposal = None
    if align != "none":
        proposal = _proposal(patient, atlas, known, align, points, should_stop)
        patient = moved(patient, proposal.transform)
        left = check_patient(patient, atlas.frame)
        _stop_at_errors(path, left)
    repairs = tuple(f"{finding.sentence}; repaired: {finding.remedy}" for finding in done)
    remarks = (*patient.remarks, *(f"{finding.sentence}; {finding.remedy}" for finding in left))
    return Intake(patient, repairs, remarks, align, proposal)


def _landmarks(align: Method, path: Path | None) -> Landmarks:
    if (align == "landmarks") != (path is not None):
        raise InputError("--align landmarks and --landmarks FILE.csv need each other; give both or neither")
    return {} if path is None else read_landmarks(path)


def _in_units(patient: Patient, scale: float | None) -> Patient:
    if scale is None:
        return patient
    if not 0 < scale < math.inf:
        raise InputError(f"--scale is {scale:g}; give the millimetres per unit of the file, as 1000")
    return replace(scaled(patient, scale), units_known=True)


def _stop_at_errors(path: Path, findings: Sequence[Finding]) -> None:
    for finding in findings:
        if finding.kind == "error":
            raise InputError(f"{path.name}: {finding.sentence}; {finding.remedy}")


def _proposal(
    patient: Patient,
    atlas: Atlas,
    known: Values,
    align: Method,
    landmarks: Landmarks,
    should_stop: StopCheck | None,
) -> Proposal:
    reference_mm = atlas.shape(known, should_stop=should_stop)
    if not len(reference_mm.faces):
        raise InputError("there is no surface at these covariates to align to; give others after --known")
    carried = {name: _moved_point(patient, point) for name, point in landmarks.items()}
    return propose(align, patient.mesh_mm, reference_mm, atlas.checkpoint.alignment, carried)


def _moved_point(patient: Patient, point: tuple[float, float, float]) -> tuple[float, float, float]:
    x, y, z = (patient.from_file @ np.array([*point, 1.0]))[:3].tolist()
    return x, y, z


def _distances(method: Method, proposal: Proposal) -> dict[str, Any]:
    numbers = {name: value for name, value in asdict(proposal).items() if name != "transform"}
    return {"method": method, **numbers}


def _told(method: Method, proposal: Proposal) -> str:
    away = "" if proposal.landmarks_mm is None else f", landmarks {proposal.landmarks_mm:.2f} mm apart"
    ends = f"{proposal.before_mm:.2f} mm before, {proposal.after_mm:.2f} mm after"
    return f"aligned by {method}; mean distance to the atlas's shape {ends}{away}"
