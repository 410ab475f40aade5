"""Patients for the engine: files read and aligned, shapes fitted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from naisr_model.progress import SILENT, Progress
from naisr_viewer.engine.engine import Engine
from naisr_viewer.engine.people import FittedPerson
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.layouts import FULL_SHAPE
from naisr_viewer.state.patients import Fitted, Labels, Named, Reading, Scan, Stated
from naisr_viewer.state.requests import EXACT_RESOLUTION, SurfaceRequest, SurfaceResult

if TYPE_CHECKING:
    from naisr_model.data.patients import PatientShape
    from naisr_model.patients.intake import Intake

SHOWN_FACES = 20_000
"""A scan is thinned to so many for display and for its distances to a shape; the fit uses all of it."""

SHOWN_SEGMENTS = 2000
"""The same of an outline, which is filled in the window's thread."""

SHOWN_POINTS = SHOWN_FACES // 2
FIT_SHARE = 0.8
"""Of a fit's progress; the rest is the surface that its volume is measured on."""


class Clinic:
    """Keeps the whole of every scan that somebody still holds, in the frame of its atlas.

    Args:
        engine: holds the atlases, and answers for everyone who was fitted.
    """

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._intakes: WeakKeyDictionary[Scan, Intake] = WeakKeyDictionary()

    def labels(self, atlas: Path, reading: Reading) -> Labels | None:
        """What to choose from, where none is chosen and it is not clear which label is meant.

        Raises:
            InputError: when a label volume cannot be used.
        """
        from naisr_model.patients import intake

        dim = self._engine.card_of(atlas).frame.dim
        titles = intake.labels(reading.path, dim) if reading.label is None else None
        return Labels(reading, tuple(titles.items())) if titles and not _is_clear(titles) else None

    @staticmethod
    def require_label(reading: Reading, card: AtlasCard | None) -> None:
        """Make sure that it is clear which label is meant, where nobody can be asked.

        Raises:
            InputError: naming the labels, when it is not, or when the volume cannot be used.
        """
        from naisr_model.patients import intake

        intake.require_label(reading.path, reading.label, 3 if card is None else card.frame.dim)

    def read(self, atlas: Path, reading: Reading, known: Named, progress: Progress = SILENT) -> Scan:
        """Read a patient's file as asked and bring it into the frame of an open atlas.

        Args:
            atlas: file of the open atlas.
            reading: what to read and how to align it.
            known: covariates; an alignment is to the atlas's shape at them.
            progress: of an alignment.

        Raises:
            InputError: when the file cannot be used.
            Cancelled: when nobody waits any more.
        """
        from naisr_model.patients import intake

        model = self._engine.atlas(atlas)
        taken = intake.read(reading.path, model, reading.label, reading.scale)
        if reading.align != "none":
            taken = intake.aligned(taken, model, dict(known), reading.align, reading.landmarks, progress)
        return self._scan(taken)

    def fit(self, atlas: Path, scan: Scan, known: Named, progress: Progress = SILENT) -> tuple[Fitted, Scan]:
        """Fit an open atlas to a patient that :meth:`read` has read; the engine then knows the person.

        Returns:
            What was found, and the scan as it lay for it: another one where it was laid onto its fit.

        Raises:
            InputError: when the shape cannot be fitted.
            Cancelled: when nobody waits any more.
        """
        from naisr_model.patients.fitting import fitted_in_place

        model, taken = self._engine.atlas(atlas), self._intakes[scan]
        fit, lies = fitted_in_place(taken, model, dict(known), progress=progress.part(0.0, FIT_SHARE))
        placed = scan if lies is taken else self._scan(lies)
        person = FittedPerson(atlas, fit, placed)
        return self._measured(person, progress.part(FIT_SHARE, 1.0)), placed

    def stated(self, atlas: Path, table: Path) -> tuple[Stated, ...]:
        """What a table of a cohort says of scans, row by row, in the covariates of an open atlas.

        Raises:
            InputError: when the table cannot be used.
        """
        from naisr_model.cohorts.table import read_cohort

        rows = read_cohort(table, self._engine.atlas(atlas).covariates).rows
        return tuple(Stated(row.scan, row.known, row.fault) for row in rows)

    def forget(self, fit: Fitted) -> None:
        """A fit that nobody asks for any more."""
        self._engine.dismiss(fit.person)

    def _scan(self, taken: Intake) -> Scan:
        scan = _scan(taken)
        self._intakes[scan] = taken
        return scan

    def _measured(self, person: FittedPerson, progress: Progress) -> Fitted:
        """What is told of a fit; the engine knows the person, unless nobody waits."""
        values, number = tuple(person.fit.covariates.items()), self._engine.admit(person)
        request = SurfaceRequest(person.atlas, FULL_SHAPE, values, EXACT_RESOLUTION, number)
        try:
            return _told(person, number, self._engine.surface(request, progress))
        except BaseException:
            self._engine.dismiss(number)
            raise


def _told(person: FittedPerson, number: int, surface: SurfaceResult) -> Fitted:
    fit = person.fit
    return Fitted(
        person=number,
        values=surface.request.values,
        intervals=tuple((name, *ends) for name, ends in fit.intervals.items()),
        extent=surface.extent,
        extent_margin=surface.extent_margin,
        residual_mm=fit.residual_mm,
        lasting=fit.lasting if person.atlas_model.capabilities.transferable else None,
        seconds=fit.seconds,
        remarks=fit.remarks,
        is_valid=fit.is_valid,
        covariances=tuple((one, other, value) for (one, other), value in fit.covariances.items()),
    )


def _is_clear(titles: Mapping[int | str, str]) -> bool:
    """A negative label alone may as well be what is outside of the shape."""
    (first, *others) = titles
    return not others and not (isinstance(first, int) and first < 0)


def _scan(taken: Intake) -> Scan:
    """A scan as the window shows it."""
    from naisr_model.data.remarks import SEVERITIES

    whole = taken.patient
    thin, dim = _thin(whole), whole.dim
    said = {
        severity: [one.text for one in taken.remarks if one.severity == severity] for severity in SEVERITIES
    }
    points_mm = _thinned(thin.mesh_mm.vertices) if thin.is_cloud else thin.mesh_mm.vertices
    normals = np.zeros_like(points_mm) if thin.is_cloud else thin.mesh_mm.vertex_normals
    return Scan(
        points_mm=np.array(points_mm, np.float32),  # a plain array: trimesh's own remember their mesh
        normals=np.array(normals, np.float32),
        faces=np.asarray(thin.mesh_mm.faces, np.int64).reshape(-1, dim),
        source=whole.source,
        extent=taken.own_extent,
        alignment=taken.alignment,
        notes=tuple(said["look"]),
        repairs=tuple(said["fine"]),
        blocked=" ".join(said["refuse"]),
        is_astray=dim == 3 and any(one.topic in ("astray", "far") for one in taken.found),
    )


def _thin(whole: PatientShape) -> PatientShape:
    """A surface of many triangles, or a curve of many segments, for display."""
    from naisr_model.data.patients import decimated
    from naisr_model.shapes.curve import Curve, thinned

    shape = whole.mesh_mm
    if isinstance(shape, Curve):
        return replace(whole, mesh_mm=thinned(shape, SHOWN_SEGMENTS))
    return decimated(whole, SHOWN_FACES) if len(shape.faces) > SHOWN_FACES else whole


def _thinned(points_mm: NDArray[np.float64]) -> NDArray[np.float64]:
    """A cloud for display."""
    return points_mm[:: -(-len(points_mm) // SHOWN_POINTS)]
