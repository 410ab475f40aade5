"""From a table of meshes to a sample store: read, check, align, scale, sample.

A shape's folder is named after the fingerprint of everything that its samples depend on (the mesh
file, the transform, the frame, the counts), is written under another name and renamed when it is
complete. A run that was killed therefore goes on where it stopped, and nothing is done twice.
"""

from __future__ import annotations

import hashlib
import json
import re
import shutil
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from naisr_model.data import align, samples, store, tables
from naisr_model.data.align import Alignment
from naisr_model.data.comparison import (
    centred,
    compared_kinds,
    compared_landmarks,
    compared_places,
    compared_shapes,
    compared_with_people,
    joined,
)
from naisr_model.data.remarks import Remark, answerable, gravest_first
from naisr_model.data.report import PreparationReport, RowRemark, rejected
from naisr_model.data.sound import sound_shape
from naisr_model.data.split import held_out_mask
from naisr_model.data.stages import Look, Placed, Sampling, inspect, place, write_samples
from naisr_model.data.tables import ShapeTable, TableRow
from naisr_model.errors import InputError
from naisr_model.files import replacing, telling
from naisr_model.frames import Frame, enclosing_frame
from naisr_model.progress import SILENT, Progress
from naisr_model.work.alone import alone
from naisr_model.work.cluster import shared
from naisr_model.work.run import Run, in_order

REPORT = "report.json"
_SAMPLES = re.compile(r"[0-9a-f]{24}")
_HALF_DONE = re.compile(r"\.[0-9a-f]{24}\.\d+\.tmp")
"""Names of the folders that :func:`_sampling` and :func:`write_samples` make."""

UNKEPT = frozenset({"workers", "cluster", "accepted"})
"""Options that say nothing of the samples."""

MOST_SAMPLES = 10_000_000
"""Of a kind and a shape: 240 MB."""


@dataclass(frozen=True)
class PrepareOptions:
    """How many samples to take of each shape, and who is held out.

    Attributes:
        surface_samples: points with normals on the surface.
        near_samples: signed distances around the surface.
        uniform_samples: signed distances evenly over the box.
        held_out: share of the subjects kept for evaluation.
        seed: of the split and of the samples.
        workers: processes; None for one a core, 1 to stay in this process.
        cluster: of dask workers that share the work in their place, see :mod:`~naisr_model.work.cluster`.
        accepted: rows of the table, the header being 1, that somebody has looked at: what only comparing
            them with the others suspects does not leave them out.
    """

    surface_samples: int = 100_000
    near_samples: int = 400_000
    uniform_samples: int = 100_000
    held_out: float = 0.2
    seed: int = 0
    workers: int | None = None
    cluster: str | None = None
    accepted: tuple[int, ...] = ()


def prepare(
    csv: str | Path,
    out: str | Path,
    *,
    options: PrepareOptions | None = None,
    progress: Progress = SILENT,
) -> PreparationReport:
    """Turn a table of meshes into a sample store.

    Args:
        csv: the table, see :mod:`naisr_model.data.tables`.
        out: folder of the store; made when missing. What it already holds is used again.
        options: sample counts, split, processes.
        progress: told the finished share; where it cancels, a later call goes on.

    Returns:
        Which rows were used, and what there is to look at; also written to ``report.json`` in the store.

    Raises:
        InputError: when the table, the options or ``out`` cannot be used, or no mesh can; with a note for
            each row that was rejected until then, since that may be why.
        Cancelled: when nobody waits any more.
    """
    options, out = options or PrepareOptions(), Path(out)
    table = _checked_table(csv, options)
    with _held(out, table.name):
        return _prepare(table, out, options, progress)


def _prepare(table: ShapeTable, out: Path, options: PrepareOptions, progress: Progress) -> PreparationReport:
    with shared(options.workers, options.cluster) as run:
        held_out = held_out_mask([row.subject for row in table.rows], options.held_out, options.seed)
        looks = [(row, table.alignment.method) for row in table.rows]
        inspected = in_order(run(inspect, looks, progress.part(0.0, 0.05)))
        inputs = _beside_each_other(table, _of_one_kind(_without_coded(table, inspected)))
        alignment, placed = _aligned(table, inputs, held_out, run, progress.part(0.05, 0.1))
        with _telling_rejected(table, [item.remarks for item in placed]):
            usable = _usable(table, placed)
            population = tables.population_from_table(table.take(usable), held_out[usable])
            frame = _common_frame([placed[i] for i in usable], table.unit)
            sources = [(inputs[i].digest, placed[i], table.rows[i]) for i in usable]
            jobs = [_sampling(*source, frame, options, out) for source in sources]
            written = in_order(run(write_samples, jobs, progress.part(0.1, 1.0)))
    folders = [job.target.name for job in jobs]
    store.write_index(
        out,
        name=table.name,
        population=population,
        frame=frame,
        alignment=alignment,
        source=table.source,
        options={key: value for key, value in asdict(options).items() if key not in UNKEPT},
        folders=folders,
    )
    _remove(out / store.SHAPES, _SAMPLES, set(folders))
    report = _report(table, inputs, placed, dict(zip(usable, written, strict=True)))
    with replacing(out / REPORT) as temporary:
        temporary.write_text(json.dumps(report.to_json(), indent=1), encoding="utf-8")
    return report


def require_possible(options: PrepareOptions) -> None:
    """Refuse what nothing can be prepared with, before anything is read.

    Raises:
        InputError: with what arrived and what is possible.
    """
    if not 0 <= options.held_out < 1:
        raise InputError(f"the held-out share is {options.held_out:g}; give a number from 0 to below 1")
    for kind in store.KINDS:
        if not 1 <= (count := getattr(options, f"{kind}_samples")) <= MOST_SAMPLES:
            raise InputError(
                f"{count} {kind} samples a shape were asked for; give at least 1, at most {MOST_SAMPLES}"
            )
    if not 0 <= options.seed < 2**32:
        raise InputError(f"the seed is {options.seed}; give 0 or more, up to {2**32 - 1}")


def _checked_table(csv: str | Path, options: PrepareOptions) -> ShapeTable:
    require_possible(options)
    table = tables.read_table(csv, options.accepted)
    if any(row.mesh == Path(csv).parent for row in table.rows):
        raise InputError(f"{Path(csv).name} has no column 'mesh'; add one with the path of each mesh")
    return table


@contextmanager
def _held(out: Path, name: str) -> Iterator[None]:
    """The folder of the store to ourselves, without what a run leaves half done that was killed or stopped.

    Raises:
        InputError: when it holds something else, or another run writes there.
    """
    _require_own(out, name)
    with telling(out):
        (out / store.SHAPES).mkdir(parents=True, exist_ok=True)
    with alone(out / ".lock", f"another run prepares {out}; wait until it has ended, or give another --out"):
        _remove(out / store.SHAPES, _HALF_DONE)
        try:
            yield
        finally:
            _remove(out / store.SHAPES, _HALF_DONE)


def _require_own(out: Path, name: str) -> None:
    if (out / REPORT).exists() and not (out / store.INDEX).exists():
        raise InputError(f"{out} holds a {REPORT} of something else; give another --out")
    try:
        other = store.SampleStore.open(out).name
    except InputError:  # of an unfinished or damaged store, which is mended
        return
    if other != name:
        raise InputError(f"{out} holds the store of '{other}', not of '{name}'; give another --out")


def _report(
    table: ShapeTable, inputs: Sequence[Look], placed: Sequence[Placed], written: dict[int, bool]
) -> PreparationReport:
    """Sum up; ``written`` tells of each usable row whether this run sampled it."""
    return PreparationReport(
        accepted=tuple(table.rows[i].number for i in written),
        skipped=tuple(table.rows[i].number for i, new in written.items() if not new),
        rejected=_on_rows(table, [_refusals(item.remarks) for item in placed]),
        warnings=_on_rows(
            table, [gravest_first(item.remarks) if i in written else () for i, item in enumerate(placed)]
        ),
        understood=table.told,
        table=(*table.remarks, *compared_with_people([look.bulk for look in inputs])),
    )


def _on_rows(table: ShapeTable, remarks: Sequence[Sequence[Remark]]) -> tuple[RowRemark, ...]:
    rows = zip(table.rows, remarks, strict=True)
    return tuple(RowRemark(row.number, str(row.mesh), one) for row, found in rows for one in found)


def _refusals(remarks: Sequence[Remark]) -> list[Remark]:
    return [remark for remark in remarks if remark.severity == "refuse"]


def _refused(remarks: Sequence[Remark]) -> bool:
    return bool(_refusals(remarks))


@contextmanager
def _telling_rejected(table: ShapeTable, remarks: Sequence[Sequence[Remark]]) -> Iterator[None]:
    """An error that follows from what is left of the table has a note for each row that is not."""
    try:
        yield
    except InputError as error:
        for remark in _on_rows(table, [_refusals(found) for found in remarks]):
            error.add_note(rejected(remark))
        raise


# --- what lies between the stages ---------------------------------------------------------------


def _without_coded(table: ShapeTable, looks: Sequence[Look]) -> list[Look]:
    """The looks without rows that have a code for a missing value, which others are not compared with."""
    coded = _answerable(table, table.codes)
    return [
        Look((*look.remarks, *codes)) if codes else look for look, codes in zip(looks, coded, strict=True)
    ]


def _of_one_kind(looks: Sequence[Look]) -> list[Look]:
    """The looks without curves among meshes, or meshes among curves, which nothing can be compared with."""
    odd = compared_kinds([look.bulk for look in looks])
    return [Look((*look.remarks, *found)) if found else look for look, found in zip(looks, odd, strict=True)]


def _answerable(table: ShapeTable, remarks: Iterable[Iterable[Remark]]) -> list[list[Remark]]:
    """What is suspected of each row, unless somebody has looked at it."""
    rows = zip(table.rows, remarks, strict=True)
    return [[answerable(remark, row.number, table.accepted) for remark in found] for row, found in rows]


def _beside_each_other(table: ShapeTable, looks: Sequence[Look]) -> list[Look]:
    """The looks with what only a comparison of rows shows, and landmarks named alike."""
    looks = [look._replace(landmarks=marks) for look, marks in zip(looks, _named_alike(looks), strict=True)]
    bulks = [look.bulk for look in looks]
    spaces = [look.space for look in looks]
    shapes = _answerable(table, compared_shapes(table.rows, bulks, spaces, table.values))
    sound = [
        look.landmarks if not _refused(found) else None for look, found in zip(looks, shapes, strict=True)
    ]
    marks = _answerable(table, compared_landmarks(sound, bulks))
    # One that lies the other way round would become what all are moved onto, or stay as it is.
    centres = [centred(bulk) for bulk in bulks] if table.alignment.method == "icp" else []
    turned = _answerable(table, compared_places(bulks, centres))
    said = [(*look.remarks, *found) for look, found in zip(looks, joined(shapes, marks, turned), strict=True)]
    return [look._replace(remarks=remarks) for look, remarks in zip(looks, said, strict=True)]


def _named_alike(looks: Sequence[Look]) -> list[align.Landmarks | None]:
    """Landmarks that differ by case alone under the name that most rows have."""
    counts = Counter(name for look in looks for name in look.landmarks or ())
    names: dict[str, str] = {}
    for name, _ in counts.most_common():
        names.setdefault(name.casefold(), name)
    return [
        look.landmarks and {names[name.casefold()]: point for name, point in look.landmarks.items()}
        for look in looks
    ]


def _aligned(
    table: ShapeTable, looks: Sequence[Look], held_out: NDArray[np.bool_], run: Run, progress: Progress
) -> tuple[Alignment, list[Placed]]:
    """The reference and every row in its frame; again without what turns out to lie wrong in it."""
    while True:
        with _telling_rejected(table, [look.remarks for look in looks]):
            alignment = _reference(table, looks, held_out)
        whole = [i for i, look in enumerate(looks) if not _refused(look.remarks)]
        places = [(alignment, table.rows[i].mesh, looks[i].landmarks) for i in whole]
        found = in_order(run(place, places, progress))
        placed = _in_one_frame(table, looks, dict(zip(whole, found, strict=True)))
        wrong = [i for i in whole if _refused(placed[i].remarks)]
        if alignment.method == "none" or held_out[wrong].all():
            return alignment, placed
        looks = [
            look._replace(remarks=placed[i].remarks) if i in wrong else look for i, look in enumerate(looks)
        ]


def _in_one_frame(table: ShapeTable, looks: Sequence[Look], found: Mapping[int, Placed]) -> list[Placed]:
    """Every row with all that was said of it, its place in the frame compared with the others'."""
    placed = [found.get(i, Placed(())) for i in range(len(looks))]
    transforms = [np.array(item.transform) if item.transform else None for item in placed]
    said = _answerable(table, compared_places([look.bulk for look in looks], transforms))
    return [
        item._replace(remarks=(*look.remarks, *item.remarks, *remarks))
        for look, item, remarks in zip(looks, placed, said, strict=True)
    ]


def _usable(table: ShapeTable, placed: Sequence[Placed]) -> list[int]:
    if usable := [i for i, item in enumerate(placed) if not _refused(item.remarks)]:
        return usable
    first = _refusals(placed[0].remarks)[0].text
    raise InputError(f"none of the {len(placed)} meshes can be used; row {table.rows[0].number}: {first}")


def _common_frame(placed: Sequence[Placed], unit: str) -> Frame:
    bounds_mm = np.array([item.bounds_mm for item in placed])
    if bounds_mm.shape[-1] == 3 and unit != "mm":
        raise InputError(f"the unit of the table is '{unit}', and meshes are in millimetres; leave it out")
    return enclosing_frame(bounds_mm[:, 0].min(axis=0), bounds_mm[:, 1].max(axis=0), unit)


def _reference(table: ShapeTable, inputs: Sequence[Look], held_out: NDArray[np.bool_]) -> Alignment:
    """Complete the table's alignment with a reference made from usable training rows."""
    if table.alignment.method == "none":
        return table.alignment
    usable = [i for i, item in enumerate(inputs) if not _refused(item.remarks) and not held_out[i]]
    if not usable:
        reasons = [refusal.text for item in inputs for refusal in _refusals(item.remarks)]
        raise InputError(
            f"no training mesh can be used; the first reason: {(reasons or ['all held out'])[0]}"
        )
    if table.alignment.method == "landmarks":
        return _landmark_reference(
            [marks for i in usable if (marks := inputs[i].landmarks)], table.alignment.origin
        )
    # The shape of median volume is the least extreme one to move the others onto.
    volumes_mm3 = {i: bulk.volume_mm3 for i in usable if (bulk := inputs[i].bulk)}
    middle = sorted(usable, key=lambda i: volumes_mm3[i])[len(usable) // 2]
    return align.icp_alignment(sound_shape(table.rows[middle].mesh).shape_mm)


def _landmark_reference(sets: Sequence[align.Landmarks], origin: str) -> Alignment:
    """Made from the rows that have whatever landmarks most rows have."""
    names = {name.casefold(): name for marks in sets for name in marks}
    origin = names.get(origin.casefold(), origin)
    counts = Counter(name for marks in sets for name in marks)
    usual = {name for name, count in counts.items() if 2 * count > len(sets)}
    complete = [marks for marks in sets if usual <= set(marks)]
    with_origin = [marks for marks in complete or sets if not origin or origin in marks]
    return align.landmark_alignment(with_origin, origin)


def _sampling(
    digest: str, placed: Placed, row: TableRow, frame: Frame, options: PrepareOptions, out: Path
) -> Sampling:
    """The fingerprint of a shape's samples names its folder and seeds its random numbers."""
    counts = (options.surface_samples, options.near_samples, options.uniform_samples)
    # Rounded to a nanometre, so that the last bits of another machine's arithmetic do not matter.
    transform = np.round(placed.transform, 9).tolist()
    key = [store.VERSION, digest, transform, frame.to_json(), counts, samples.NEAR_SIGMAS, options.seed]
    fingerprint = hashlib.sha256(json.dumps(key).encode()).hexdigest()
    target = out / store.SHAPES / fingerprint[:24]
    return Sampling(row.mesh, placed.transform, frame, counts, int(fingerprint[24:40], 16), target)


def _remove(folder: Path, pattern: re.Pattern[str], known: Set[str] = frozenset()) -> None:
    """Delete what is named so and not ``known``: the user may keep other things here."""
    for path in folder.iterdir():
        if path.name not in known and pattern.fullmatch(path.name):
            shutil.rmtree(path, ignore_errors=True)
