"""Rows compared with each other: what fits in no population can only be seen beside the others.

The same mesh twice, a mesh in metres among millimetres, one in RAS among LPS, debris far away, landmarks
swapped: each row gets its own remarks. A robust middle is what the others are like, so that a few bad rows
do not hide each other.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from naisr_model.data.align import Landmarks
from naisr_model.data.remarks import Remark
from naisr_model.data.sheets import numbered
from naisr_model.data.tables import TableRow
from naisr_model.frames import UNITS_MM, Frame
from naisr_model.shapes.kinds import KINDS, Shape, kind_of

Remarks = list[list[Remark]]
"""What is said of each row."""

POINTS = 1000
"""Of a surface, for :class:`Bulk`."""

HUMAN_MM = (1.0, 3000.0)
"""How long a part of a person may be."""

FEWEST_ROWS = 5
"""With fewer rows nobody can say which of them is the odd one."""

SAME = 2e-6
"""Relative difference of volumes, areas and moments up to which two meshes are the same, perhaps moved; what
is left of the digits in a text file. Two people differ in the second digit."""

SIZE_GAP = np.log(4.0)
"""Between neighbours in size (as logarithms): growth leaves no such gap, another unit does."""

ODD_SIZE, ODD_VOLUME = np.log(1.4), np.log(2.0)
"""How far a size or a volume must be from what is expected, however much alike the others are."""

FAR_OFF = 6.0
"""Standard deviations, estimated from the median absolute deviation."""

LONG = 3.0
"""Length over bulk, as a multiple of the others', from which pieces lie far from the rest."""

MISPLACED = 0.4
"""How far a landmark may lie from where the others have it, over the radius of all landmarks; anatomy takes
half of it."""

FLIPS = {
    "turned by half about z, as RAS is to LPS": (-1.0, -1.0, 1.0),
    "mirrored left to right": (-1.0, 1.0, 1.0),
    "mirrored front to back": (1.0, -1.0, 1.0),
    "mirrored upside down": (1.0, 1.0, -1.0),
}
"""What exporters confuse, as signs of the axes."""

FLAT_FLIPS = {
    "turned by half": (-1.0, -1.0),
    "mirrored left to right": (-1.0, 1.0),
    "mirrored upside down": (1.0, -1.0),
}
"""The same of curves in the plane."""


@dataclass(frozen=True, eq=False)
class Bulk:
    """What is measured of a mesh, or a curve in the plane, for comparison, in its own coordinates.

    Attributes:
        points_mm: some points evenly over its surface, ``[n, dim]``.
        volume_mm3: enclosed; of a curve the area.
        area_mm2: of the surface; of a curve the length.
        length_mm: the longest side of its box.
        spreads_mm: standard deviations of the surface along its principal axes, ``[dim]``; they do not
            change when it is moved.
    """

    points_mm: NDArray[np.float64]
    volume_mm3: float
    area_mm2: float
    length_mm: float
    spreads_mm: NDArray[np.float64]

    @property
    def dim(self) -> int:
        """2 for curves, 3 for meshes."""
        return self.points_mm.shape[1]

    @property
    def noun(self) -> str:
        """What it is called."""
        return KINDS[self.dim].noun

    @property
    def unit(self) -> str:
        """Of its lengths, as far as that is known of it alone."""
        return "mm" if self.dim == 3 else "units"

    @property
    def radius_mm(self) -> float:
        """Median distance of the surface from its middle, which pieces far away do not change."""
        middle = np.median(self.points_mm, axis=0)
        return float(np.median(np.linalg.norm(self.points_mm - middle, axis=1)))


def measured(mesh_mm: Shape) -> Bulk:
    """What is compared of a closed surface or curve."""
    areas, middles = kind_of(mesh_mm).parts(mesh_mm)
    centre = np.average(middles, axis=0, weights=areas)
    covariance = np.cov((middles - centre).T, aweights=areas, ddof=0)
    points = mesh_mm.sample(POINTS, seed=0)
    return Bulk(
        points_mm=np.asarray(points),
        volume_mm3=float(mesh_mm.volume),
        area_mm2=float(areas.sum()),
        length_mm=float(np.ptp(mesh_mm.vertices, axis=0).max()),
        spreads_mm=np.sqrt(np.maximum(np.linalg.eigvalsh(covariance), 0)),
    )


def compared_with_people(bulks: Sequence[Bulk | None]) -> tuple[Remark, ...]:
    """What is odd about all meshes together."""
    lengths = [bulk.length_mm for bulk in bulks if bulk is not None and bulk.dim == 3]
    if not lengths or HUMAN_MM[0] <= np.median(lengths) <= HUMAN_MM[1]:
        return ()
    sentence = f"the meshes are {np.median(lengths):.3g} mm long, as half of them show"
    return (Remark("look", "units", sentence, "look at their unit, which must be millimetres"),)


def compared_kinds(bulks: Sequence[Bulk | None]) -> Remarks:
    """Curves among meshes, or meshes among curves: what there are fewer of."""
    counts = Counter(bulk.dim for bulk in bulks if bulk is not None)
    usual = max(counts, key=lambda dim: (counts[dim], dim), default=3)
    return [
        [
            Remark(
                "refuse",
                "kind",
                f"it is a {bulk.noun}, most others are {KINDS[usual].plural}",
                "prepare them apart",
            )
        ]
        if bulk is not None and bulk.dim != usual
        else []
        for bulk in bulks
    ]


# --- the meshes by themselves ------------------------------------------------------------------


def compared_shapes(
    rows: Sequence[TableRow], bulks: Sequence[Bulk | None], spaces: Sequence[str], values: NDArray[np.float64]
) -> Remarks:
    """Remarks on each row by its mesh alone, wherever it lies.

    Args:
        rows: of the table.
        bulks: of each row's mesh; None where it cannot be used.
        spaces: LPS or RAS where the file states it, else empty.
        values: covariates in real units, ``[n, N]``.
    """
    there = [i for i, bulk in enumerate(bulks) if bulk is not None]
    measured = [bulk for bulk in bulks if bulk is not None]
    found: Remarks = [[] for _ in rows]
    for part in (
        _repeated([rows[i] for i in there], measured),
        _misplaced_spaces([spaces[i] for i in there]),
        _odd_sizes(measured, values[there]),
    ):
        for i, remarks in zip(there, part, strict=True):
            found[i] += remarks
    return found


def _repeated(rows: Sequence[TableRow], bulks: Sequence[Bulk]) -> Remarks:
    """The same mesh in several rows, under whatever name and in whatever place."""
    found: Remarks = [[] for _ in rows]
    for group in _same(np.array([_signature(bulk) for bulk in bulks])):
        for i in group:
            others = [j for j in group if j != i]
            where = f"the {bulks[i].noun} is that of {numbered([rows[j].number for j in others])}"
            if strangers := sorted({rows[j].subject for j in others} - {rows[i].subject}):
                names = ", ".join(f"'{name}'" for name in strangers[:5])
                whose = f"{where}, of another subject ({names})"
                found[i].append(
                    Remark("refuse", "repeated", whose, f"give each subject its own {bulks[i].noun}")
                )
            else:
                found[i].append(Remark("look", "repeated", f"{where}, another visit of the same subject"))
    return found


def _signature(bulk: Bulk) -> list[float]:
    return [
        bulk.volume_mm3 ** (1 / bulk.dim),
        bulk.area_mm2 ** (1 / (bulk.dim - 1)),
        *bulk.spreads_mm,
    ]


def _same(signatures: NDArray[np.float64]) -> list[list[int]]:
    """Groups of rows whose signatures agree."""
    groups: list[list[int]] = []
    for i in np.argsort(signatures[:, 0]) if len(signatures) else ():
        last = signatures[groups[-1][-1]] if groups else None
        if last is not None and np.abs(signatures[i] - last).max() <= SAME * signatures[i].max():
            groups[-1].append(int(i))
        else:
            groups.append([int(i)])
    return [group for group in groups if len(group) > 1]


def _misplaced_spaces(spaces: Sequence[str]) -> Remarks:
    """Files that state another space than most of those that state one."""
    stated = [space for space in spaces if space]
    usual = max(("LPS", "RAS"), key=stated.count)
    sentence = (
        f"the file says that its coordinates are {'RAS' if usual == 'LPS' else 'LPS'}, most say {usual}"
    )
    remark = Remark("refuse", "space", sentence, f"export it as {usual}")
    return [[remark] if space and space != usual else [] for space in spaces]


def _odd_sizes(bulks: Sequence[Bulk], values: NDArray[np.float64]) -> Remarks:
    """Sizes far from those of the others, and volumes far from what their covariates make expected."""
    found: Remarks = [[] for _ in bulks]
    if len(bulks) < FEWEST_ROWS:
        return found
    size = np.log([bulk.radius_mm for bulk in bulks])
    usual = _usual_sizes(size)
    refused = ~usual
    expected = _expected(size, values, usual)
    refused |= np.abs(size - expected) > np.maximum(FAR_OFF * _scale(size - expected, 0.05, usual), SIZE_GAP)
    odd = np.abs(size - expected) > np.maximum(FAR_OFF * _scale(size - expected, 0.05, usual), ODD_SIZE)
    volume = np.log([bulk.volume_mm3 for bulk in bulks])
    beside = volume - _expected(volume, values, usual & ~refused)
    odd_volume = np.abs(beside) > np.maximum(FAR_OFF * _scale(beside, 0.1, usual & ~refused), ODD_VOLUME)
    slender = np.array([bulk.length_mm / bulk.radius_mm for bulk in bulks])
    for i, bulk in enumerate(bulks):
        ratio = float(np.exp(size[i] - expected[i]))
        if refused[i]:
            found[i].append(_another_size(bulk, ratio, True))
        elif slender[i] > LONG * np.median(slender):
            found[i].append(_with_debris(bulk, bulks))
        elif odd[i]:
            found[i].append(_another_size(bulk, ratio, False))
        elif odd_volume[i]:
            found[i].append(_another_volume(bulk, float(np.exp(beside[i]))))
    return found


def _usual_sizes(size: NDArray[np.float64]) -> NDArray[np.bool_]:
    """The largest group of sizes without a gap; of equally large ones the one in millimetres, if any is."""
    order = np.argsort(size)
    group = np.zeros(len(size), np.int64)
    group[order[1:]] = np.cumsum(np.diff(size[order]) > SIZE_GAP)
    counts = np.bincount(group)
    largest = np.flatnonzero(counts == counts.max())
    human = [g for g in largest if HUMAN_MM[0] < np.exp(np.median(size[group == g])) < HUMAN_MM[1]]
    return np.isin(group, largest if len(largest) < 2 else human if len(human) == 1 else [])


def _expected(
    numbers: NDArray[np.float64], values: NDArray[np.float64], usual: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """What covariates make expected: least squares with Tukey's weights on them and their squares.

    With few rows squares have to be left out, and with very few the median has to do.
    """
    design = _design(values, squares=True)
    if usual.sum() < 4 * design.shape[1]:
        design = _design(values, squares=False)
    if usual.sum() < 4 * design.shape[1]:
        return np.full(len(numbers), np.median(numbers[usual]) if usual.any() else np.median(numbers))
    weights = usual.astype(np.float64)
    for step in range(20):
        root = np.sqrt(weights)[:, None]
        solution = np.linalg.lstsq(design * root, numbers * root[:, 0], rcond=None)[0]
        rest = numbers - design @ solution
        scale = _scale(rest, 1e-3, usual)
        far = np.abs(rest) / (4.685 * scale)
        # Least absolute deviations first, since no start by squares survives a factor of thousand.
        robust = (
            1 / np.maximum(np.abs(rest), 0.1 * scale) if step < 8 else np.where(far < 1, (1 - far**2) ** 2, 0)
        )
        weights = usual * robust
    return np.asarray(design @ solution)


def _design(values: NDArray[np.float64], *, squares: bool) -> NDArray[np.float64]:
    """1, each covariate in standard deviations, and its square where it has more than two values."""
    columns = [np.ones(len(values))]
    for column in values.T:
        scaled = (column - column.mean()) / (column.std() or 1.0)
        columns += [scaled, scaled**2] if squares and len(np.unique(column)) > 2 else [scaled]
    return np.stack(columns, axis=1)


def _scale(rest: NDArray[np.float64], floor: float, usual: NDArray[np.bool_]) -> float:
    """A standard deviation from the median absolute deviation."""
    chosen = rest[usual] if usual.any() else rest
    return max(1.4826 * float(np.median(np.abs(chosen - np.median(chosen)))), floor)


def _another_size(bulk: Bulk, ratio: float, certain: bool) -> Remark:
    long = f"the {bulk.noun} is {bulk.length_mm:.3g} {bulk.unit} long"
    sentence = f"{long}, {_compared(ratio)} usual at such covariates"
    others = {unit: factor for unit, factor in UNITS_MM.items() if factor != 1}
    fits = [unit for unit, factor in others.items() if abs(np.log(ratio * factor)) < np.log(1.6)]
    unit = "millimetres" if bulk.dim == 3 else "that of the others"
    remedy = f"look at its unit, which must be {unit}, and at its covariates"
    if fits and bulk.dim == 3:
        remedy = f"its unit looks like {fits[0]}, so scale it by {UNITS_MM[fits[0]]:g}"
    return Remark("refuse" if certain else "look", "size", sentence, remedy)


def _another_volume(bulk: Bulk, ratio: float) -> Remark:
    extent = Frame((0.0,) * bulk.dim, 1.0, bulk.unit).extent
    volume = f"the {extent.title} is {bulk.volume_mm3 / extent.per_unit:.3g} {extent.unit}"
    sentence = f"{volume}, {_compared(ratio)} usual at such covariates"
    return Remark("look", extent.title, sentence, "look whether it is whole, and at its covariates")


def _with_debris(bulk: Bulk, bulks: Sequence[Bulk]) -> Remark:
    usual = np.median([one.length_mm for one in bulks])
    sentence = (
        f"the {bulk.noun} is {bulk.length_mm:.0f} {bulk.unit} long, usual are {usual:.0f} {bulk.unit}, and "
        f"its bulk is like that of the others, so pieces lie far from the rest"
    )
    return Remark("refuse", "debris", sentence, "remove them, or the others lose resolution")


def _compared(ratio: float) -> str:
    """``3.2 times as large as``, ``1,080 times smaller than``."""
    times = max(ratio, 1 / ratio)
    number = f"{times:,.0f}" if times >= 100 else f"{times:.2g}"
    return f"{number} times as large as" if ratio >= 1 else f"{number} times smaller than"


# --- landmarks ---------------------------------------------------------------------------------


def compared_landmarks(sets: Sequence[Landmarks | None], bulks: Sequence[Bulk | None]) -> Remarks:
    """Remarks on each row by its landmarks: swapped, mirrored, of another unit, away from the mesh.

    Args:
        sets: landmarks of each row in the coordinates of its mesh; None for rows that cannot be used.
        bulks: of each row's mesh.
    """
    found: Remarks = [[] for _ in sets]
    there = [i for i, marks in enumerate(sets) if marks and len(marks) >= 3 and bulks[i] is not None]
    if len(there) < FEWEST_ROWS:
        return found
    marked = [_Marked(dict(sets[i] or {}), bulk) for i in there if (bulk := bulks[i]) is not None]
    middle = _middle([one.points for one in marked])
    usual = float(np.median([_residual(one.points, middle) for one in marked]))
    spread = float(np.median([np.log(one.spread) for one in marked]))
    away = float(np.median([one.away for one in marked]))
    for i, one in zip(there, marked, strict=True):
        found[i] += _odd_landmarks(one, middle, usual, spread, away)
    return found


@dataclass(frozen=True, eq=False)
class _Marked:
    points: Landmarks
    bulk: Bulk

    @property
    def spread(self) -> float:
        """Radius of the landmarks over that of the mesh."""
        points = np.array(list(self.points.values()))
        return max(float(_radius(points)) / self.bulk.radius_mm, 1e-12)

    @property
    def away(self) -> float:
        """From the middle of the mesh to that of the landmarks, over the radius of the mesh."""
        points = np.array(list(self.points.values()))
        shift = np.median(points, axis=0) - self.bulk.points_mm.mean(axis=0)
        return float(np.linalg.norm(shift)) / self.bulk.radius_mm


def _radius(points: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.square(points - points.mean(axis=0)).sum(axis=1).mean()))


def _middle(sets: Sequence[Landmarks]) -> Landmarks:
    """The set that is most like the others, of up to 25 tried that have what most have."""
    counts = Counter(name for one in sets for name in one)
    usual = {name for name, count in counts.items() if 2 * count > len(sets)}
    whole = [one for one in sets if usual <= set(one)] or list(sets)
    tried = [whole[i] for i in np.unique(np.linspace(0, len(whole) - 1, 25).astype(int))]
    return min(tried, key=lambda one: float(np.median([_residual(other, one) for other in sets])))


def _residual(points: Landmarks, goal: Landmarks, *, mirrored: bool = False) -> float:
    """Root mean square distance after the best rotation, shift and scale, over the radius of ``goal``."""
    return float(np.sqrt(np.square(_distances(points, goal, mirrored=mirrored)[1]).mean()))


def _distances(
    points: Landmarks, goal: Landmarks, *, mirrored: bool = False
) -> tuple[list[str], NDArray[np.float64]]:
    """Shared names and how far apart each is (Umeyama, 1991), over the radius of ``goal``."""
    names = [name for name in goal if name in points]
    if len(names) < 3:
        return names, np.full(1, np.inf)
    moving, fixed = (np.array([marks[name] for name in names]) for marks in (points, goal))
    moving, fixed = moving - moving.mean(axis=0), fixed - fixed.mean(axis=0)
    size, goal_size = max(_radius(moving), 1e-12), max(_radius(fixed), 1e-12)
    moving, fixed = moving / size, fixed / goal_size
    left, stretch, right = np.linalg.svd(fixed.T @ moving)
    sign = np.linalg.det(left @ right) * (-1 if mirrored else 1)
    left[:, 2] *= sign
    scale = (stretch[0] + stretch[1] + sign * stretch[2]) / len(names)
    return names, np.linalg.norm(scale * moving @ (left @ right).T - fixed, axis=1)


def _odd_landmarks(one: _Marked, middle: Landmarks, usual: float, spread: float, away: float) -> list[Remark]:
    """At most one remark: the first that explains the row."""
    if abs(np.log(one.spread) - spread) > np.log(3.0):
        ratio = float(np.exp(np.log(one.spread) - spread))
        sentence = f"the spread of the landmarks beside the mesh is {_compared(ratio)} usual"
        return [Remark("refuse", "landmarks", sentence, "give them in the unit of the mesh, millimetres")]
    if one.away > 5 * max(away, 0.5):
        away_mm = one.away * one.bulk.radius_mm
        sentence = f"the landmarks lie {away_mm:.0f} mm from the middle of the mesh, farther than usual"
        certain = away_mm > one.bulk.length_mm
        return [
            Remark(
                "refuse" if certain else "look", "landmarks", sentence, "give both in one frame, LPS or RAS"
            )
        ]
    names, distances = _distances(one.points, middle)
    if len(names) < 3:  # too few for an alignment too, which says so
        return []
    rest = _residual(one.points, middle)
    if rest <= max(2.5 * usual, 0.02):
        return _incomplete(one.points, middle)
    pair = min(combinations(names, 2), key=lambda two: _residual(_swapped(one.points, *two), middle))
    swapped = _residual(_swapped(one.points, *pair), middle)
    mirrored = _residual(one.points, middle, mirrored=True)
    if mirrored < min(swapped, 0.5 * rest):
        sentence = "the landmarks are mirrored"
        return [Remark("refuse", "landmarks", sentence, "give them in the frame of the mesh")]
    if swapped < 0.5 * rest:
        sentence = f"the landmarks '{pair[0]}' and '{pair[1]}' look swapped"
        return [Remark("refuse", "landmarks", sentence, "exchange their names")]
    if rest <= max(5 * usual, 0.15):
        return _incomplete(one.points, middle)
    worst = names[int(distances.argmax())]
    sentence = f"the landmarks lie otherwise than those of the others, most of all '{worst}'"
    certain = bool(distances.max() > MISPLACED)
    return [Remark("refuse" if certain else "look", "landmarks", sentence, "set them again")]


def _incomplete(points: Landmarks, middle: Landmarks) -> list[Remark]:
    missing = ", ".join(f"'{name}'" for name in middle if name not in points)
    sentence = f"it has no landmark {missing}, which others have"
    return [Remark("look", "landmarks", sentence, "set it for a better alignment")] if missing else []


def _swapped(points: Landmarks, one: str, other: str) -> Landmarks:
    return {**points, one: points[other], other: points[one]}


# --- in the atlas frame ------------------------------------------------------------------------


def compared_places(
    bulks: Sequence[Bulk | None], transforms: Sequence[NDArray[np.float64] | None]
) -> Remarks:
    """Remarks on each row by where its mesh lies in the atlas frame: place, space, shape.

    Args:
        bulks: of each row's mesh.
        transforms: ``[dim + 1, dim + 1]``, coordinates of the mesh to the atlas frame; None for rows that
            cannot be used, and empty to compare nothing.
    """
    found: Remarks = [[] for _ in bulks]
    pairs = zip(bulks, transforms, strict=False)
    there = [i for i, pair in enumerate(pairs) if pair[0] is not None and pair[1] is not None]
    if len(there) < FEWEST_ROWS:
        return found
    lying = [
        _Lying(bulk, t) for i in there if (bulk := bulks[i]) is not None and (t := transforms[i]) is not None
    ]
    centres = np.array([one.points_mm.mean(axis=0) for one in lying])
    middle = np.median(centres, axis=0)
    length = float(np.median([one.bulk.length_mm for one in lying]))
    away = np.linalg.norm(centres - middle, axis=1)
    usual = max(float(np.median(away)), 0.15 * length)
    reference = _typical(lying)
    misfits = np.array([_misfit(one.points_mm, reference) for one in lying])
    for number, (i, one) in enumerate(zip(there, lying, strict=True)):
        flip = _flip(one, reference, float(misfits[number]), float(np.median(misfits)))
        if flip:
            sentence = f"the {one.bulk.noun} fits the others only when it is {flip}"
            found[i].append(Remark("refuse", "space", sentence, "export it in the space of the others"))
        elif away[number] > 5 * usual:
            found[i].append(_elsewhere(one.bulk, float(away[number]), usual, bool(away[number] > 10 * usual)))
    return found


def _typical(lying: Sequence[_Lying]) -> _Lying:
    """Of some meshes of about median volume the one that lies most like the others."""
    middle = np.median([one.bulk.volume_mm3 for one in lying])
    tried = sorted(lying, key=lambda one: abs(one.bulk.volume_mm3 - middle))[:5]
    misfits = [np.median([_misfit(other.points_mm, one) for other in lying]) for one in tried]
    return tried[int(np.argmin(misfits))]


def centred(bulk: Bulk | None) -> NDArray[np.float64] | None:
    """The shift that puts the middle of a mesh at 0, ``[dim + 1, dim + 1]``."""
    if bulk is None:
        return None
    shift = np.eye(bulk.dim + 1)
    shift[:-1, -1] = -bulk.points_mm.mean(axis=0)
    return shift


@dataclass(frozen=True, eq=False)
class _Lying:
    bulk: Bulk
    transform: NDArray[np.float64]

    @property
    def points_mm(self) -> NDArray[np.float64]:
        return self.moved(self.bulk.points_mm)

    def moved(self, points_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(points_mm @ self.transform[:-1, :-1].T + self.transform[:-1, -1])


def _misfit(points_mm: NDArray[np.float64], reference: _Lying) -> float:
    """Mean distance to the nearest point of the other, both ways, once it is as large as the reference."""
    centre = points_mm.mean(axis=0)
    scale = _radius(reference.points_mm) / max(_radius(points_mm), 1e-12)
    sized, goal = (points_mm - centre) * scale + centre, reference.points_mm
    to, back = cKDTree(goal).query(sized)[0], cKDTree(sized).query(goal)[0]
    return float(to.mean() + back.mean()) / 2


def _flip(one: _Lying, reference: _Lying, misfit: float, usual: float) -> str:
    """What the mesh has to be turned or mirrored by to fit the others; empty where nothing is better."""
    if misfit <= 2 * usual:
        return ""
    flips: Mapping[str, tuple[float, ...]] = FLIPS if one.bulk.dim == 3 else FLAT_FLIPS
    best = min(flips, key=lambda name: _flipped_misfit(one, reference, np.array(flips[name])))
    better = _flipped_misfit(one, reference, np.array(flips[best]))
    return best if better < min(0.5 * misfit, 2 * usual) else ""


def _flipped_misfit(one: _Lying, reference: _Lying, signs: NDArray[np.float64]) -> float:
    """About the scanner's origin, as a wrong space has it, or about the mesh, as an alignment leaves it."""
    points, moved = one.bulk.points_mm, one.points_mm
    centre = moved.mean(axis=0)
    flips = (one.moved(points * signs), (moved - centre) * signs + centre)
    return min(_misfit(flipped, reference) for flipped in flips)


def _elsewhere(bulk: Bulk, away_mm: float, usual_mm: float, certain: bool) -> Remark:
    away, usual = (
        f"{length:.3g} {bulk.unit}" if bulk.dim == 2 else f"{length:.0f} mm" for length in (away_mm, usual_mm)
    )
    sentence = f"the {bulk.noun} lies {away} from the middle of the others, usual are {usual}"
    remedy = "export it in the same frame"
    if bulk.dim == 3:
        remedy += ', or set method = "icp" under [alignment] in the TOML'
    return Remark("refuse" if certain else "look", "place", sentence, remedy)


def joined(*parts: Remarks) -> Remarks:
    """What several comparisons say of each row."""
    return [[remark for remarks in row for remark in remarks] for row in zip(*parts, strict=True)]
