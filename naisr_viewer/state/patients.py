"""What the window knows of patients: their scans and fits, as frozen values."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from naisr_model.files import Stamp

Named = tuple[tuple[str, float], ...]
"""Real covariate values by name, hashable."""

Method = Literal["none", "icp", "landmarks"]
"""How a scan is moved to the atlas."""


@dataclass(frozen=True)
class Reading:
    """How a patient's file is read and placed.

    Attributes:
        path: a mesh, whole or in part, a label volume or a cloud of points; in the plane a drawing, points or
            a label image.
        label: which label of a volume, its number or its name; None where there is only one.
        scale: millimetres per unit of the file; None to guess where the size is implausible.
        align: how it is moved to the atlas.
        landmarks: a CSV name,x,y,z in the coordinates of the file; for ``landmarks``.
    """

    path: Path
    label: int | str | None = None
    scale: float | None = None
    align: Method = "none"
    landmarks: Path | None = None


@dataclass(frozen=True)
class Labels:
    """A label volume of which one label is to be chosen.

    Attributes:
        reading: the file, still without a label.
        titles: what :class:`Reading` calls each label, and its description.
    """

    reading: Reading
    titles: tuple[tuple[int | str, str], ...]


@dataclass(frozen=True)
class Stated:
    """What a table says of one scan.

    Attributes:
        path: of the scan.
        known: covariates that are given.
        fault: why the row cannot be used, a sentence; empty where it can.
    """

    path: Path
    known: Named
    fault: str = ""


@dataclass(frozen=True, eq=False)
class Scan:
    """A patient's measured shape in the frame of the atlas.

    Attributes:
        points_mm: vertices for display, float32 ``[n, dim]``.
        normals: unit normals there, float32 ``[n, dim]``; 0 for a cloud of points.
        faces: vertex numbers of the triangles or segments, int64 ``[m, dim]``; none for a cloud of points.
        source: what was read, for example ``p01.stl, 12,034 faces``.
        extent: what it encloses, a volume or an area; None where it is open.
        alignment: how it was moved to the atlas, a sentence; empty where it was not.
        notes: what is odd and has to be looked at, a sentence each.
        repairs: what was set right or does no harm, a sentence each.
        blocked: what forbids a fit and what to do about it, a sentence; empty where nothing does.
        is_astray: whether it lies elsewhere than the shapes of the atlas do, so that it is aligned first;
            curves are not.
    """

    points_mm: NDArray[np.float32]
    normals: NDArray[np.float32]
    faces: NDArray[np.int64]
    source: str
    extent: float | None = None
    alignment: str = ""
    notes: tuple[str, ...] = ()
    repairs: tuple[str, ...] = ()
    blocked: str = ""
    is_astray: bool = False


@dataclass(frozen=True)
class Fitted:
    """What a fit found.

    Attributes:
        person: names the code in requests; every fit has another one, and 0 is the population average.
        values: real values of all covariates.
        intervals: name, low and high end (95 %) of each inferred covariate.
        extent: what the fitted shape encloses.
        extent_margin: half of its 95 % interval; None where the shape is the template.
        residual_mm: mean distance of the scan to the fitted surface.
        lasting: share of what sets the person apart that is kept at other covariates; None where the shape
            model knows nobody at others.
        seconds: what the fit took.
        remarks: what the shape does not settle, or that it was missed, a sentence each.
        is_valid: whether the shape was met; where not, nothing else here means anything.
        covariances: of each pair of inferred continuous covariates, and of each with itself: two names, and
            the product of their units.
    """

    person: int
    values: Named
    intervals: tuple[tuple[str, float, float], ...]
    extent: float
    extent_margin: float | None
    residual_mm: float
    lasting: float | None
    seconds: float
    remarks: tuple[str, ...] = ()
    is_valid: bool = True
    covariances: tuple[tuple[str, str, float], ...] = ()


@dataclass(frozen=True, eq=False)
class OpenScan:
    """One scan that is open.

    Attributes:
        key: tells the open scans apart.
        name: what the list shows, for example ``p01.stl``.
        reading: how the file was read.
        scan: the measured shape.
        known: covariates that are given; the others are inferred.
        fit: None before the first fit.
        written: of the file, when it was read.
        is_changed: whether the file has changed on the disk since.
        aligned_at: covariates of the shape that the scan was aligned to.
    """

    key: int
    name: str
    reading: Reading
    scan: Scan
    known: Named = ()
    fit: Fitted | None = None
    written: Stamp = None
    is_changed: bool = False
    aligned_at: Named = ()
