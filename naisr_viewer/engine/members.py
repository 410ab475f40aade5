"""What can be said of someone who was fitted, as numbers on surfaces. Knows no Qt."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from naisr_viewer.state.patients import Named, Scan
from naisr_viewer.state.requests import Colouring

if TYPE_CHECKING:
    from naisr_model.atlas import Fit, Individual

DISTANCE_SHARE, CERTAINTY_SHARE, CHANGE_SHARE = 0.02, 0.015, 0.08
"""Ends of the colour scales as shares of the atlas's unit of length, about half of its largest shape;
rounded to 1, 2 or 5. They never depend on the patient, so that patients can be compared."""

PROBED, BLENDED = 1500, 4
"""Vertices at which the surface's uncertainty is computed, and how many of them are blended for each of the
others, by their inverse distances: it is smooth where the fit is good, within a tenth of its value."""


@dataclass(frozen=True, eq=False)
class Member:
    """Someone an open atlas was fitted to.

    Attributes:
        atlas: its file.
        fit: what was found.
        scan: the measured shape.
    """

    atlas: Path
    fit: Fit
    scan: Scan

    def at(self, values: Named) -> Individual:
        """The person at these covariates, the others at the population centre."""
        centre = {covariate.name: covariate.centre for covariate in self.fit.individual.atlas.covariates}
        return self.fit.at(centre | dict(values))


def distances(member: Member, values: Named) -> Colouring:
    """How far the scan is from the person's shape at ``values``, at its vertices; positive outside."""
    atlas, latent = member.fit.individual.atlas, member.at(values).latent
    found = atlas.sdf(member.scan.points_mm, dict(values), latent)
    limit_mm = rounded(DISTANCE_SHARE * atlas.frame.scale_mm)
    return Colouring(found.astype(np.float32), limit_mm, is_signed=True)


def certainty(member: Member, values: Named, points_mm: NDArray[np.float32]) -> Colouring:
    """Half of the 95 % interval of a surface's place along its normal, at its vertices."""
    from scipy.spatial import cKDTree

    from naisr_model.learning.fitting.posterior import TWO_SIDED_95

    probed = points_mm[:: max(1, len(points_mm) // PROBED)]
    deviations_mm = member.at(values).surface_sd_mm(probed)
    away_mm, nearest = cKDTree(probed).query(points_mm, k=min(BLENDED, len(probed)))
    weights = 1 / (away_mm.reshape(len(points_mm), -1) + 1e-6)
    blended_mm = np.average(deviations_mm[nearest.reshape(weights.shape)], axis=1, weights=weights)
    half = (TWO_SIDED_95 * blended_mm).astype(np.float32)
    limit_mm = rounded(CERTAINTY_SHARE * member.fit.individual.atlas.frame.scale_mm)
    return Colouring(half, limit_mm, is_signed=False)


def change(
    member: Member,
    before_mm: NDArray[np.float32],
    after_mm: NDArray[np.float32],
    normals: NDArray[np.float32],
) -> Colouring:
    """How far corresponding points ``[n, 3]`` have moved along the normals of the later surface."""
    moved_mm = np.sum((after_mm - before_mm) * normals, axis=1)
    limit_mm = rounded(CHANGE_SHARE * member.fit.individual.atlas.frame.scale_mm)
    return Colouring(moved_mm.astype(np.float32), limit_mm, is_signed=True)


def rounded(length: float) -> float:
    """The nearest of 1, 2, 5, 10, 20, 50 ... by ratio."""
    decade = 10.0 ** math.floor(math.log10(length))
    return min((step * decade for step in (1, 2, 5, 10)), key=lambda step: abs(math.log(step / length)))
