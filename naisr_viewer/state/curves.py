"""How measures change along a covariate, and where a patient stands among people."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from naisr_viewer.state.patients import Named
from naisr_viewer.state.pins import Pin

DISTANCE = "distance"
"""The measure that there is while two places are pinned."""

Numbers = NDArray[np.float64]


@dataclass(frozen=True)
class CurveChoice:
    """Which curve the user wants to see.

    Attributes:
        measure: its name.
        covariate: along which; empty for the one that was moved last.
    """

    measure: str = "volume"
    covariate: str = ""


FIRST_CURVE = CurveChoice()


@dataclass(frozen=True)
class CurveRequest:
    """What is asked about measures along a covariate; where along it the shapes on screen are is no matter.

    Attributes:
        atlas: the file of the atlas.
        covariate: along which.
        others: real values of the other covariates.
        person: who else is followed; 0 for nobody.
        pins: two places whose distance is measured, or none.
    """

    atlas: Path
    covariate: str
    others: Named
    person: int
    pins: tuple[Pin, ...] = ()


@dataclass(frozen=True)
class Sighting:
    """A measure of a patient at the covariates of the fit.

    Attributes:
        place: value of the covariate that the curve is along.
        value: the measure.
        margin: half of its 95 % interval; None where that is not known.
    """

    place: float
    value: float
    margin: float | None


@dataclass(frozen=True, eq=False)
class MeasureCurve:
    """One measure along a covariate, at n places.

    Attributes:
        name: of the measure.
        title: as people read it.
        unit: of the numbers.
        definition: how it is measured, in words.
        usual: of the population's shape, ``[n]``.
        path: the same where the other continuous covariates grow along, ``[n]``; None where there are none.
        band: both ends of what 95 % of the people have, ``[n]`` each; None as long as that is not known.
        sure: both ends of where ``usual`` is with a probability of 95 %, ``[n]`` each; None likewise, and
            where people are too few to say.
        observed: of the training visits, ``[S]``; None likewise.
        own: of the patient, ``[n]``; None where nobody is followed.
        sighting: of the patient, when seen; None for nobody.
    """

    name: str
    title: str
    unit: str
    definition: str
    usual: Numbers
    path: Numbers | None = None
    band: tuple[Numbers, Numbers] | None = None
    sure: tuple[Numbers, Numbers] | None = None
    observed: Numbers | None = None
    own: Numbers | None = None
    sighting: Sighting | None = None


@dataclass(frozen=True, eq=False)
class Curves:
    """The answer to a :class:`CurveRequest`.

    Attributes:
        request: the question.
        places: values of the covariate, ``[n]``.
        visits: the same of the training visits, ``[S]``.
        measures: all that these shapes have.
    """

    request: CurveRequest
    places: Numbers
    visits: Numbers
    measures: tuple[MeasureCurve, ...]

    def find(self, measure: str) -> MeasureCurve:
        """The curve of a measure; the first one where there is none of that name."""
        return next((one for one in self.measures if one.name == measure), self.measures[0])


@dataclass(frozen=True)
class Standing:
    """Where a measure of a patient stands among people of the same covariates.

    Attributes:
        title: as people read it.
        unit: of the numbers.
        definition: how it is measured, in words.
        value: the patient's.
        margin: half of its 95 % interval.
        low: 2.5 % of the people have less.
        high: 2.5 % of them have more.
        percentile: share of them that have less than the patient, 0 to 100.
        z: how many standard deviations the patient is above their median.
    """

    title: str
    unit: str
    definition: str
    value: float
    margin: float
    low: float
    high: float
    percentile: float
    z: float


@dataclass(frozen=True)
class Reckoning:
    """How far it is known what is usual among the people of an atlas.

    Attributes:
        share: of the work that is done, 0 to 1; None while nobody works.
        trouble: why nobody does, a sentence; empty where there is no reason.
        can_begin: whether the user may have it done.
    """

    share: float | None = None
    trouble: str = ""
    can_begin: bool = False


NOTHING_RECKONED = Reckoning()


class Readout(NamedTuple):
    """What there is at a place along a curve.

    Attributes:
        usual: of the population's shape.
        sure: where that is with a probability of 95 %; None where it is not known.
        band: what 95 % of the people have; None likewise.
        own: of the patient; None where nobody is followed.
    """

    usual: float
    sure: tuple[float, float] | None
    band: tuple[float, float] | None
    own: float | None


def readout(curves: Curves, curve: MeasureCurve, place: float) -> Readout:
    """Between the places that were measured, on straight lines."""

    def at(values: Numbers) -> float:
        return float(np.interp(place, curves.places, values))

    sure, band = (None if ends is None else (at(ends[0]), at(ends[1])) for ends in (curve.sure, curve.band))
    return Readout(at(curve.usual), sure, band, None if curve.own is None else at(curve.own))
