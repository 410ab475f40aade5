"""Pinned places: which material point was clicked, where it is elsewhere, and what moved it there."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from naisr_model.covariates import Values
from naisr_model.errors import InputError
from naisr_viewer.engine.answers.base import Source
from naisr_viewer.state.pins import Entry, Ledger, LedgerRequest, Part, Pin, Point, Shown
from naisr_viewer.state.requests import SurfaceRequest

if TYPE_CHECKING:
    from naisr_model.atlas import Atlas, Contributions
    from naisr_model.measures.norms import Norms


Code = NDArray[np.float64] | None
"""Of a person; None for the population average."""


def origin_mm(source: Source, request: SurfaceRequest, point_mm: Point) -> Point:
    """Which point of the template is at a point of the surface that answered ``request``.

    Raises:
        Cancelled: when nobody asks for that atlas or person any more.
        InputError: when the file of the atlas has been replaced since it was opened.
    """
    latent = _latent(source, request.atlas, Shown(request.panel, request.values, request.person))
    atlas = source.atlas(request.atlas)
    place_mm = point_mm[: atlas.frame.dim]
    return as_point(atlas.origins_mm([place_mm], dict(request.values), latent)[0])


def ledger(source: Source, request: LedgerRequest) -> Ledger:
    """Answer ``request``; takes milliseconds.

    Raises:
        Cancelled: when nobody asks for that atlas or person any more.
        InputError: when the file of the atlas has been replaced since it was opened.
    """
    atlas, shapes = source.atlas(request.atlas), (request.whole, *request.others)
    latents = [_latent(source, request.atlas, shown) for shown in shapes]
    found = _found(atlas, request.pins, shapes, latents)
    entries = tuple(entry for entry, _ in found)
    norms = source.known_norms(request.atlas) if request.has_norms else None
    if norms is not None:
        with suppress(InputError):  # too few people to say
            entries = _with_margins(entries, norms, dict(request.whole.values))
    where = [
        (shown.panel, tuple((entry.pin.number, as_point(places_mm[i])) for entry, places_mm in found))
        for i, shown in enumerate(shapes)
    ]
    return Ledger(request, entries, tuple(where))


def _found(
    atlas: Atlas, pins: Sequence[Pin], shapes: Sequence[Shown], latents: Sequence[Code]
) -> list[tuple[Entry, NDArray[np.float64]]]:
    """What is told of each pin, and where it is in every shape, ``[shapes, dim]``.

    A pin at which a deformation folds is left out.
    """
    origins_mm, values = (
        [pin.origin_mm[: atlas.frame.dim] for pin in pins],
        [dict(shown.values) for shown in shapes],
    )
    average = np.zeros_like(atlas.checkpoint.latents[0])
    codes = [average if latent is None else latent for latent in latents]
    try:
        places_mm = atlas.carried_mm(origins_mm, values, codes)
        whole = atlas.contributions(origins_mm, values[0], latents[0], places_mm[0])
    except InputError:
        singly = [[pin] for pin in pins if len(pins) > 1]
        return [found for pin in singly for found in _found(atlas, pin, shapes, latents)]
    has_person = bool(shapes[0].person)
    return [
        (_entry(pin, whole, i, atlas.population.names, has_person), places_mm[:, i])
        for i, pin in enumerate(pins)
    ]


def _with_margins(entries: tuple[Entry, ...], norms: Norms, values: Values) -> tuple[Entry, ...]:
    """How sure each part is, but for what sets a person apart.

    Raises:
        InputError: when people are too few to say.
    """
    origins_mm = np.array([entry.pin.origin_mm for entry in entries]).reshape(-1, 3)
    ways = [{name: value} for name, value in values.items()]
    *effects, together = norms.effect_margins_mm(origins_mm, [*ways, values])
    singly = dict(zip(values, effects, strict=True))
    return tuple(
        replace(
            entry,
            parts=tuple(replace(part, margin_mm=float(singly[part.cause][i])) for part in entry.parts),
            total=replace(entry.total, margin_mm=None if entry.person else float(together[i])),
        )
        for i, entry in enumerate(entries)
    )


def _latent(source: Source, path: Path, shown: Shown) -> Code:
    fitted = source.who(path, shown.person).fitted
    return None if fitted is None else fitted.at(shown.values).latent


def _entry(pin: Pin, found: Contributions, i: int, names: Sequence[str], has_person: bool) -> Entry:
    normal, effects_mm, person_mm = found.normals[i], found.effects_mm[:, i], found.person_mm[i]
    return Entry(
        pin,
        tuple(_part(name, effect_mm, normal) for name, effect_mm in zip(names, effects_mm, strict=True)),
        _part("", person_mm, normal) if has_person else None,
        _part("", effects_mm.sum(axis=0) + person_mm, normal),
    )


def _part(cause: str, moved_mm: NDArray[np.float64], normal: NDArray[np.float32]) -> Part:
    along_mm = float(moved_mm @ normal)
    return Part(cause, along_mm, float(np.linalg.norm(moved_mm - along_mm * normal)))


def as_point(point_mm: NDArray[np.float64]) -> Point:
    """``[dim]`` as a value that can be compared; in the plane z is 0."""
    x, y, z = [*point_mm.tolist(), 0.0][:3]
    return x, y, z
