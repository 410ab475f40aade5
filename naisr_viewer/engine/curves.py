"""Measures along a covariate, and where a patient's stand among people."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from naisr_model.covariates import Covariate, Values, growth_path
from naisr_model.errors import InputError
from naisr_model.progress import SILENT, Progress
from naisr_viewer.engine.answers.base import Source
from naisr_viewer.state.curves import (
    DISTANCE,
    CurveRequest,
    Curves,
    MeasureCurve,
    Numbers,
    Sighting,
    Standing,
)

if TYPE_CHECKING:
    from naisr_model.atlas import Atlas, Individual
    from naisr_model.measures.curves import Gauge
    from naisr_model.measures.kinds import Measure, Surface
    from naisr_model.measures.norms import Norm, Norms, Spread

PLACES = 25
"""Along a continuous covariate, at which shapes are measured."""


@dataclass(frozen=True, eq=False)
class Way:
    """Where shapes are measured.

    Attributes:
        places: values of the covariate, ``[n]``.
        alone: covariate values there while the others stay as they are.
        grown: the same while the other continuous ones grow along; none where there are none.
    """

    places: Numbers
    alone: Sequence[Values]
    grown: Sequence[Values]


@dataclass(frozen=True, eq=False)
class Carried:
    """A template carried along a way.

    Attributes:
        usual: to the population's shapes, others staying.
        grown: the same, others growing along.
        own: to a person's, others staying; none where nobody is followed.
    """

    usual: Sequence[Surface]
    grown: Sequence[Surface]
    own: Sequence[Surface]


@dataclass(frozen=True, eq=False)
class Seen:
    """A person as seen.

    Attributes:
        covariates: real values by name.
        gauge: the fine and the coarse template carried to that shape; measures that person.
        margins: half of the 95 % interval of each measure, by its name.
    """

    covariates: Values
    gauge: Gauge
    margins: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class Among:
    """A measure among the people behind an atlas.

    Attributes:
        spread: how it differs among them.
        observed: of the training visits, ``[S]``.
        sure: both ends of where the population's is, by itself, with a probability of 95 %, as shares of it
            along the way, ``[2, n]``; None where that is not known.
    """

    spread: Spread
    observed: Numbers
    sure: Numbers | None


def curves(source: Source, request: CurveRequest, progress: Progress = SILENT) -> Curves:
    """Answer ``request``; takes some seconds. What 95 % of people have is told once that is known.

    Raises:
        InputError: where the deformation folds, or when the file of the atlas has been replaced since it was
            opened.
        Cancelled: when nobody waits any more, or asks for that atlas or person.
    """
    atlas, gauge = source.atlas(request.atlas), source.gauge(request.atlas)
    fitted = source.who(request.atlas, request.person).fitted
    person = None if fitted is None else fitted.fit.individual
    way, norms = way_of(atlas, request), source.known_norms(request.atlas)
    carried = _carried(atlas, gauge.coarse, way, person, progress.part(0.0, 0.8))
    seen = None if person is None else _seen(atlas, gauge, person)
    among = {} if norms is None else {name: _among(norms, name, way) for name in norms.own}
    told = [_curve(request.covariate, gauge, one, carried, among, seen) for one in gauge.measures.values()]
    if len(request.pins) == 2:
        told.append(_distance(atlas, request, way, person, norms is not None, progress.part(0.8, 1.0)))
    return Curves(request, way.places, atlas.population.observed(request.covariate), tuple(told))


def standings(source: Source, path: Path, number: int, progress: Progress = SILENT) -> tuple[Standing, ...]:
    """Where every measure of a fitted patient stands among people of the covariates of the fit.

    Nothing where it is not known what is usual.

    Raises:
        Cancelled: when nobody waits any more, or asks for that atlas or person.
    """
    norms, fitted = source.known_norms(path), source.who(path, number).fitted
    if norms is None or fitted is None:
        return ()
    seen = _seen(norms.atlas, norms.gauge, fitted.fit.individual)
    progress.check()
    own = {name: one.of(seen.gauge.fine) for name, one in norms.gauge.measures.items()}
    found = norms.norms(seen.covariates, own)
    return tuple(
        _standing(one, own[name], seen.margins[name], found[name])
        for name, one in norms.gauge.measures.items()
    )


def _standing(measure: Measure, value: float, margin: float, norm: Norm) -> Standing:
    what = measure.title, measure.unit, measure.definition
    return Standing(*what, value, margin, norm.low, norm.high, norm.percentile, norm.z)


def way_of(atlas: Atlas, request: CurveRequest) -> Way:
    """Where shapes are measured for a request; of a binary covariate at its levels."""
    covariate = next(each for each in atlas.covariates if each.name == request.covariate)
    places = np.linspace(*covariate.range, 2 if covariate.kind == "binary" else PLACES)
    others = dict(request.others)
    alone = [{**others, covariate.name: float(place)} for place in places]
    grown = [{**row, **_along(atlas, covariate, row)} for row in alone] if _grows(atlas, covariate) else []
    return Way(places, alone, grown)


def _grows(atlas: Atlas, covariate: Covariate) -> bool:
    """Whether others grow along with a covariate."""
    return covariate.kind == "continuous" and sum(c.kind == "continuous" for c in atlas.covariates) > 1


def _along(atlas: Atlas, covariate: Covariate, values: Values) -> dict[str, float]:
    """The other continuous covariates as they are in the mean at a value of one."""
    row = growth_path(atlas.population, covariate.name, np.array([values[covariate.name]]))[0]
    pairs = zip(atlas.covariates, row, strict=True)
    return {one.name: float(value) for one, value in pairs if one.kind == "continuous"}


def _carried(
    atlas: Atlas, template: Surface, way: Way, person: Individual | None, progress: Progress
) -> Carried:
    """The template along the way, for the population and for whoever is followed."""
    from naisr_model.measures.curves import shapes_along

    count, everywhere = len(way.alone), [*way.alone, *way.grown]
    mean = shapes_along(atlas, template, everywhere, progress=progress.part(0.0, 0.6))
    follows = () if person is None or not atlas.capabilities.transferable else way.alone
    own = shapes_along(atlas, template, follows, person, progress=progress.part(0.6, 1.0)) if follows else ()
    return Carried(mean[:count], mean[count:], own)


def _seen(atlas: Atlas, gauge: Gauge, person: Individual) -> Seen:
    from naisr_model.measures.curves import Gauge, shapes_along
    from naisr_model.measures.margins import margins

    fine, coarse = (
        shapes_along(atlas, template, [person.covariates], person)[0]
        for template in (gauge.fine, gauge.coarse)
    )
    own, found = Gauge(fine, coarse, gauge.known), margins(person, coarse, gauge.measures)
    sure = {name: found[name] * one.of(fine) / one.of(coarse) for name, one in gauge.measures.items()}
    return Seen(person.covariates, own, sure)


def _among(norms: Norms, measure: str, way: Way) -> Among:
    sure = None
    with suppress(InputError):  # too few people to say
        sure = norms.intervals(measure, way.alone, np.ones(len(way.alone)))
    return Among(norms.spreads[measure], norms.own[measure], sure)


def _curve(
    along: str,
    gauge: Gauge,
    measure: Measure,
    carried: Carried,
    people: Mapping[str, Among],
    seen: Seen | None,
) -> MeasureCurve:
    usual, among = gauge.curve(measure, carried.usual), people.get(measure.name)
    return MeasureCurve(
        measure.name,
        measure.title,
        measure.unit,
        measure.definition,
        usual,
        gauge.curve(measure, carried.grown) if carried.grown else None,
        None if among is None else among.spread.band(usual),
        None if among is None or among.sure is None else (usual * among.sure[0], usual * among.sure[1]),
        None if among is None else among.observed,
        seen.gauge.curve(measure, carried.own) if seen is not None and carried.own else None,
        None if seen is None else _sighting(along, measure, seen),
    )


def _sighting(along: str, measure: Measure, seen: Seen) -> Sighting:
    return Sighting(seen.covariates[along], measure.of(seen.gauge.fine), seen.margins.get(measure.name))


def _distance(
    atlas: Atlas,
    request: CurveRequest,
    way: Way,
    person: Individual | None,
    has_norms: bool,
    progress: Progress,
) -> MeasureCurve:
    """That of two pinned places: only they are carried. How sure a patient's is, nobody knows."""
    from naisr_model.measures.curves import Gauge, shapes_along
    from naisr_model.measures.kinds import Anchor, Surface, distance
    from naisr_model.measures.norms import people_of, spread_of

    dim, unit = atlas.frame.dim, atlas.frame.unit
    points_mm = np.array([pin.origin_mm[:dim] for pin in request.pins])
    ends = Surface(points_mm, np.zeros((0, dim), dtype=np.int64), False, None)
    first, second = (Anchor((i, i, i), (1.0, 0.0, 0.0)) for i in range(2))
    measure = distance(first, second, unit=unit)
    carried = _carried(atlas, ends, way, person, progress.part(0.0, 0.5))
    among: dict[str, Among] = {}
    if has_norms:
        people = people_of(atlas, ends, progress=progress.part(0.5, 1.0))
        with suppress(InputError):  # the same for everybody
            among[DISTANCE] = Among(spread_of(people, measure), people.own(measure), None)
    seen = None
    if person is not None:
        own = shapes_along(atlas, ends, [person.covariates], person)[0]
        seen = Seen(person.covariates, Gauge(own, own), {})
    return _curve(request.covariate, Gauge(ends, ends), measure, carried, among, seen)
