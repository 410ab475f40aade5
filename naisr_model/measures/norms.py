"""What is usual at given covariates: a measure, and the place of every point of the surface.

The training people are taken as the atlas reconstructs them, each at their own covariates with their own
code, beside the population's shape at the same covariates. How much larger or smaller theirs is, as a share,
is what people differ by; that share is taken for equally spread at all covariates, and for log-normal.

To push the spread of the codes through the model at the covariates in question would be the obvious way, and
is wrong for this model: where a covariate is at its centre no code can move anything by it, so that the
spread comes out too small near the centre of the population and too large away from it. Over 120 new airways
z of volume was then 1.8 times as wide as it should be at 100 to 160 months, and 0.7 times beyond.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import igl
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ndtr

from naisr_model.atlas import Atlas
from naisr_model.covariates import LEAST_PEOPLE, Values
from naisr_model.errors import InputError
from naisr_model.learning.fitting.posterior import TWO_SIDED_95
from naisr_model.measures.confidence import Confidence, Design, confidence_of, design_of
from naisr_model.measures.curves import Gauge, curve, gauge_of, shapes_along
from naisr_model.measures.kinds import VOLUME, Measure, Surface
from naisr_model.progress import SILENT, Progress
from naisr_model.surface.blending import blended

WIDENING = 1.1
"""Standard deviation among people whom the networks were not fitted to, over that among the training people.
Chosen over 150 synthetic airways of another seed than those of training and ``naisr evaluate norms``."""

RECONSTRUCTED, MEASURED = 0.8, 0.9
"""Share of the work that is done then."""

LEAST_DIFFERENCE = 1e-6
"""Of ratios; below it everybody is alike."""


@dataclass(frozen=True, eq=False)
class People:
    """The training people as an atlas reconstructs them, S of them.

    Attributes:
        covariates: real values by name, of each.
        template: the coarse one, ``n`` vertices.
        own_mm: their own shapes, ``[S, n, 3]``.
        usual_mm: the population's at their covariates, ``[S, n, 3]``.
    """

    covariates: tuple[Values, ...]
    template: Surface
    own_mm: NDArray[np.float64]
    usual_mm: NDArray[np.float64]

    def own(self, measure: Measure) -> NDArray[np.float64]:
        """A measure of each, on the coarse surface, ``[S]``."""
        return curve(measure, map(self.template.moved, self.own_mm))

    def usual(self, measure: Measure) -> NDArray[np.float64]:
        """The same of the population's shapes, ``[S]``."""
        return curve(measure, map(self.template.moved, self.usual_mm))


@dataclass(frozen=True)
class Norm:
    """A value among those of people with the same covariates.

    Attributes:
        median: half of them have less.
        low: 2.5 % have less.
        high: 2.5 % have more.
        percentile: share of them that have less than the value, 0 to 100.
        z: how many standard deviations the value lies above the median.
    """

    median: float
    low: float
    high: float
    percentile: float
    z: float


@dataclass(frozen=True, eq=False)
class Spread:
    """How a measure differs among people of the same covariates.

    Attributes:
        ratios: of each training person's to the population's at the same covariates, ``[S]``.
    """

    ratios: NDArray[np.float64]

    @property
    def centre(self) -> float:
        """Mean of the ratios' logarithms."""
        return float(np.log(self.ratios).mean())

    @property
    def sd(self) -> float:
        """Standard deviation of the ratios' logarithms among people who are new."""
        return WIDENING * float(np.log(self.ratios).std(ddof=1))

    def band(self, expected: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Both ends of what 95 % of the people have, where the population's shape has ``expected``."""
        middle, margin = np.asarray(expected) * np.exp(self.centre), np.exp(TWO_SIDED_95 * self.sd)
        return middle / margin, middle * margin

    def norm(self, value: float, expected: float) -> Norm:
        """Where ``value`` stands among people whose covariates give the population's shape ``expected``.

        Raises:
            InputError: when either is not above 0.
        """
        if not (value > 0 and expected > 0):
            raise InputError(f"there is no norm of {min(value, expected):g}; it needs a value above 0")
        low, high = self.band(expected)
        z = (np.log(value / expected) - self.centre) / self.sd
        median = float(expected * np.exp(self.centre))
        return Norm(median, float(low), float(high), 100 * float(ndtr(z)), float(z))


def people_of(atlas: Atlas, template: Surface, *, progress: Progress = SILENT) -> People:
    """Reconstruct everybody an atlas was trained on, with two cores in half a minute.

    Args:
        atlas: whose people they are.
        template: what is carried to them: the whole of it coarse, or some points.
        progress: told the finished share, checked between some people.

    Raises:
        InputError: when they are too few, where the model deforms no template, or where it folds.
        Cancelled: when nobody waits any more.
    """
    population, codes = atlas.population, atlas.checkpoint.latents
    if not population.tells_what_is_usual:
        raise InputError(
            f"the atlas was trained on {len(codes)} shapes; what is usual takes {LEAST_PEOPLE} or more"
        )
    rows = [population.row(int(index)) for index in np.flatnonzero(~population.held_out)]
    usual = atlas.carried_mm(template.points_mm, rows, progress=progress.part(0.0, 0.5))
    own = atlas.carried_mm(template.points_mm, rows, codes, progress=progress.part(0.5, 1.0))
    return People(tuple(rows), template, own, usual)


def spread_of(people: People, measure: Measure) -> Spread:
    """How a measure differs among people of the same covariates; coarseness cancels out of the ratios.

    Raises:
        InputError: when their shapes have no such measure, or are all alike.
    """
    if not measure.is_possible(people.template):
        raise InputError(f"shapes of this atlas have no {measure.title.lower()}")
    return _spread(people.own(measure) / people.usual(measure))


def _spread(ratios: NDArray[np.float64]) -> Spread:
    if not (ratios > 0).all() or np.ptp(ratios) < LEAST_DIFFERENCE:
        raise InputError("the atlas does not tell its people apart, so nothing is usual; train it for longer")
    return Spread(ratios)


@dataclass(frozen=True, eq=False)
class LocalSpread:
    """How far people's surfaces lie from the population's at the same covariates, by place.

    Attributes:
        origins_mm: points of the template, ``[n, 3]``.
        offsets: of each training person's surface from the population's at the same covariates, outwards, as
            a share of the side of a cube of the same volume, ``[S, n]``.
        template: whose volume is meant.
    """

    origins_mm: NDArray[np.float64]
    offsets: NDArray[np.float16]
    template: Surface

    @cached_property
    def shares(self) -> NDArray[np.float64]:
        """Standard deviation at each point among people who are new, ``[n]``."""
        return np.asarray(WIDENING * np.sqrt(np.mean(self.offsets.astype(np.float64) ** 2, axis=0)))

    def sd_mm(self, atlas: Atlas, points_mm: ArrayLike, covariates: Values) -> NDArray[np.float64]:
        """Standard deviation of people's surfaces along the normal, ``[n]``.

        Args:
            atlas: of the people.
            points_mm: on the population's surface at the covariates or near it, ``[n, 3]``.
            covariates: real values by name.

        Raises:
            InputError: for an unknown covariate or one out of range.
        """
        origins = atlas.origins_mm(points_mm, covariates)
        (shape,) = shapes_along(atlas, self.template, [covariates])
        return blended(self.origins_mm, self.shares, origins) * _size_mm(shape)

    def scores(self, atlas: Atlas, points_mm: ArrayLike, covariates: Values) -> NDArray[np.float64]:
        """How many standard deviations points of a patient lie outside the population's surface, ``[n]``.

        Beyond 1.96 on either side is where 95 % of people of the same covariates are not.

        Raises:
            InputError: for an unknown covariate or one out of range.
        """
        return atlas.sdf(points_mm, covariates) / self.sd_mm(atlas, points_mm, covariates)


def local_spread_of(people: People, *, progress: Progress = SILENT) -> LocalSpread:
    """How far the training people's surfaces lie from the population's, by the place on the template.

    It is the signed distance from a point of the population's surface to the person's.

    Raises:
        Cancelled: when nobody waits any more.
    """
    pairs = list(zip(people.usual_mm, people.own_mm, strict=True))
    away = np.stack([_distances(people.template, *pair) for pair, _ in progress.over(pairs)])
    sizes = np.array([_size_mm(people.template.moved(points_mm)) for points_mm in people.usual_mm])
    offsets = (away / sizes[:, None]).astype(np.float16)  # to a thousandth of each, in a fourth of the room
    return LocalSpread(np.asarray(people.template.points_mm), offsets, people.template)


def _size_mm(surface: Surface) -> float:
    """Side of the cube that holds as much."""
    return float(np.cbrt(1000 * VOLUME.of(surface)))


def _distances(
    template: Surface, points_mm: NDArray[np.float64], surface_mm: NDArray[np.float64]
) -> NDArray[np.float64]:
    faces = np.asarray(template.faces, dtype=np.int64)
    found: Sequence[NDArray[np.float64]] = igl.signed_distance(points_mm, surface_mm, faces)
    return -np.asarray(found[0])  # inside the person is where the person reaches farther


@dataclass(frozen=True, eq=False)
class Norms:
    """What is usual among the people of an atlas; of their shapes nothing is kept.

    Attributes:
        atlas: whose people they are.
        gauge: measures their shapes.
        own: every measure of each training person, ``[S]``, by its name.
        spreads: how it differs among people, by its name.
        local: how their surfaces do.
    """

    atlas: Atlas
    gauge: Gauge
    own: Mapping[str, NDArray[np.float64]]
    spreads: Mapping[str, Spread]
    local: LocalSpread

    def usual(self, covariates: Values) -> dict[str, float]:
        """Every measure of the population's shape at some covariates.

        Raises:
            InputError: for an unknown covariate or one out of range.
        """
        (shape,) = shapes_along(self.atlas, self.gauge.fine, [covariates])
        return {name: one.of(shape) for name, one in self.gauge.measures.items()}

    @cached_property
    def design(self) -> Design:
        """Of what people differ by.

        Raises:
            InputError: when they are too few for their covariates.
        """
        return design_of(self.atlas.population)

    @cached_property
    def _sure(self) -> dict[str, Confidence]:
        logarithms = {name: np.log(one.ratios)[:, None] for name, one in self.spreads.items()}
        return {name: confidence_of(self.design, column) for name, column in logarithms.items()}

    @cached_property
    def _sure_locally(self) -> Confidence:
        usual_cm3 = self.own[VOLUME.name] / self.spreads[VOLUME.name].ratios
        sizes_mm = np.cbrt(1000 * usual_cm3)
        return confidence_of(self.design, self.local.offsets.astype(np.float64) * sizes_mm[:, None])

    def intervals(self, name: str, ways: Sequence[Values], usual: ArrayLike) -> NDArray[np.float64]:
        """Where a measure of the population's shapes is with a probability of 95 %, ``[2, m]``.

        Args:
            name: of the measure.
            ways: real covariate values by name, of m shapes; those left out are at the centre, so that the
                interval of an effect's shape is asked for by its covariate alone.
            usual: the measure of each.

        Raises:
            InputError: when people are too few to say.
        """
        margins = [self._sure[name].margin(self.design.row(values))[0] for values in ways]
        return np.asarray(usual) * np.exp(np.array([[-1.0], [1.0]]) * margins)

    def effect_margins_mm(self, origins_mm: ArrayLike, ways: Sequence[Values]) -> NDArray[np.float64]:
        """Half of the 95 % interval of how far covariates move points along the normal, ``[m, n]``.

        Args:
            origins_mm: the points on the template, ``[n, 3]``.
            ways: m sets of real values by name; those left out stay at the centre and move nothing.

        Raises:
            InputError: when people are too few to say.
        """
        centre = self.design.row({})
        margins_mm = [self._sure_locally.margin(self.design.row(values) - centre) for values in ways]
        return blended(self.local.origins_mm, np.stack(margins_mm, axis=1), np.asarray(origins_mm)).T

    def norms(self, covariates: Values, values: Mapping[str, float]) -> dict[str, Norm]:
        """Where values stand among people of the same covariates, by the name of the measure.

        Raises:
            InputError: for an unknown covariate or one out of range, and for a value that is not above 0.
        """
        usual = self.usual(covariates)
        return {name: self.spreads[name].norm(values[name], usual[name]) for name in usual if name in values}


def norms_of(atlas: Atlas, *, progress: Progress = SILENT) -> Norms:
    """What is usual among the people of an atlas; takes the better part of a minute.

    Raises:
        InputError: when they are too few or all alike, where the model deforms no template, where it folds,
            or where it is one of curves.
        Cancelled: when nobody waits any more.
    """
    if atlas.frame.dim != 3:
        raise InputError(
            "surfaces alone are measured so; the area of a curve is told by 'naisr fit' and 'mesh'"
        )
    gauge = gauge_of(atlas, progress=progress.quiet)
    people = people_of(atlas, gauge.coarse, progress=progress.part(0.0, RECONSTRUCTED))
    own, usual = (
        gauge.curves([people.template.moved(points_mm) for points_mm in shapes], progress=progress.quiet)
        for shapes in (people.own_mm, people.usual_mm)
    )
    spreads = {name: _spread(own[name] / usual[name]) for name in own}
    return Norms(atlas, gauge, own, spreads, local_spread_of(people, progress=progress.part(MEASURED, 1.0)))
