"""From a table of meshes to a sample store: read, check, align, scale, sample.

A shape's folder is named after the fingerprint of everything that its samples depend on (the mesh
file, the transform, the frame, the counts), is written under another name and renamed when it is
complete. A run that was killed therefore goes on where it stopped, and nothing is done twice.
"""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import os
import re
import shutil
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import trimesh
from numpy.typing import NDArray

from naisr_model.data import align, meshes, samples, store, tables
from naisr_model.data.align import Alignment
from naisr_model.data.split import held_out_mask
from naisr_model.data.tables import ShapeTable, TableRow
from naisr_model.errors import Cancelled, InputError
from naisr_model.files import replacing
from naisr_model.frames import Frame, enclosing_frame

Progress = Callable[[float], None]
REPORT = "report.json"
_OWN_NAME = re.compile(r"[0-9a-f]{24}|\.[0-9a-f]{24}\.\d+\.tmp")


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
    """

    surface_samples: int = 100_000
    near_samples: int = 400_000
    uniform_samples: int = 100_000
    held_out: float = 0.2
    seed: int = 0
    workers: int | None = None


class Remark(NamedTuple):
    """Something about one row of the table: its line (the header is 1), its mesh, and what."""

    row: int
    path: str
    reason: str


@dataclass(frozen=True)
class PreparationReport:
    """What became of each row of the table; rows by line number, the header being 1.

    Attributes:
        accepted: rows that are in the store.
        skipped: those of them whose samples an earlier run had already written.
        rejected: rows that could not be used, with the reason.
        warnings: rows that were used although something is odd.
    """

    accepted: tuple[int, ...]
    skipped: tuple[int, ...]
    rejected: tuple[Remark, ...]
    warnings: tuple[Remark, ...]

    def to_json(self) -> dict[str, Any]:
        """A plain dictionary for ``report.json``."""
        record = asdict(self)
        for key in ("rejected", "warnings"):
            record[key] = [remark._asdict() for remark in getattr(self, key)]
        return record


class _Input(NamedTuple):
    """What the first look at one row gives; ``reason`` is empty for a usable row."""

    reason: str = ""
    warnings: tuple[str, ...] = ()
    digest: str = ""
    volume_mm3: float = 0.0
    landmarks: align.Landmarks | None = None


class _Placed(NamedTuple):
    """One row in the atlas frame: scanner to atlas, and its bounds there in millimetres."""

    reason: str
    transform: tuple[tuple[float, ...], ...] = ()
    bounds_mm: tuple[tuple[float, ...], ...] = ()


class _Job(NamedTuple):
    """Everything needed to write the samples of one shape."""

    mesh: Path
    transform: tuple[tuple[float, ...], ...]
    frame: Frame
    options: PrepareOptions
    seed: int
    target: Path


def prepare(
    csv: str | Path,
    out: str | Path,
    *,
    options: PrepareOptions | None = None,
    progress: Progress | None = None,
    should_stop: Callable[[], bool] | None = None,
) -> PreparationReport:
    """Turn a table of meshes into a sample store.

    Args:
        csv: the table, see :mod:`naisr_model.data.tables`.
        out: folder of the store; made when missing. What it already holds is used again.
        options: sample counts, split, processes.
        progress: called with the fraction done.
        should_stop: polled; true cancels, and a later call goes on.

    Returns:
        Which rows were used; also written to ``report.json`` in the store.

    Raises:
        InputError: when the table, the options or ``out`` cannot be used, or no mesh can.
        Cancelled: when ``should_stop()`` turned true.
    """
    options, out = options or PrepareOptions(), Path(out)
    table = _checked_table(csv, options)
    _make_folder(out / store.SHAPES)
    held_out = held_out_mask([row.subject for row in table.rows], options.held_out, options.seed)
    with _runner(options.workers, should_stop) as run:
        looks = [(row, table.alignment.method) for row in table.rows]
        inputs = run(_inspect, looks, _share(progress, 0.0, 0.05))
        alignment = _reference(table, inputs, held_out)
        places = [(alignment, row.mesh, item) for row, item in zip(table.rows, inputs, strict=True)]
        placed = run(_place, places, _share(progress, 0.05, 0.1))
        usable = _usable(table, placed)
        population = tables.population_from_table(table.take(usable), held_out[usable])
        frame = _common_frame([placed[i] for i in usable])
        jobs = [_job(inputs[i].digest, placed[i], table.rows[i], frame, options, out) for i in usable]
        written = run(_write_samples, jobs, _share(progress, 0.1, 1.0))
    folders = [job.target.name for job in jobs]
    store.write_index(
        out,
        name=table.name,
        population=population,
        frame=frame,
        alignment=alignment,
        source=table.source,
        options={key: value for key, value in asdict(options).items() if key != "workers"},
        folders=folders,
    )
    _remove_strangers(out / store.SHAPES, set(folders))
    report = _report(table, inputs, placed, dict(zip(usable, written, strict=True)))
    with replacing(out / REPORT) as temporary:
        temporary.write_text(json.dumps(report.to_json(), indent=1), encoding="utf-8")
    return report


def _checked_table(csv: str | Path, options: PrepareOptions) -> ShapeTable:
    if not 0 <= options.held_out < 1:
        raise InputError(f"the held-out share is {options.held_out:g}; give a number from 0 to below 1")
    if min(options.surface_samples, options.near_samples, options.uniform_samples) < 1:
        raise InputError("the numbers of samples must be at least 1")
    if options.seed < 0:
        raise InputError(f"the seed is {options.seed}; give 0 or more")
    if options.workers is not None and options.workers < 1:
        raise InputError(f"the number of workers is {options.workers}; give at least 1")
    table = tables.read_table(csv)
    if any(row.mesh == Path(csv).parent for row in table.rows):
        raise InputError(f"{Path(csv).name} has no column 'mesh'; add one with the path of each mesh")
    return table


def _make_folder(path: Path) -> None:
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"the folder {path} cannot be made ({error}); choose another place") from error


def _report(
    table: ShapeTable, inputs: Sequence[_Input], placed: Sequence[_Placed], written: dict[int, bool]
) -> PreparationReport:
    """Sum up; ``written`` tells of each usable row whether this run sampled it."""

    def remarks(reasons: Sequence[str]) -> tuple[Remark, ...]:
        rows = zip(table.rows, reasons, strict=True)
        return tuple(Remark(row.number, str(row.mesh), reason) for row, reason in rows if reason)

    return PreparationReport(
        accepted=tuple(table.rows[i].number for i in written),
        skipped=tuple(table.rows[i].number for i, new in written.items() if not new),
        rejected=remarks([item.reason for item in placed]),
        warnings=remarks(["; ".join(inputs[i].warnings) if i in written else "" for i in range(len(inputs))]),
    )


def _share(progress: Progress | None, start: float, end: float) -> Progress | None:
    """Map the progress of one stage into its share of the whole."""
    return None if progress is None else lambda fraction: progress(start + (end - start) * fraction)


# --- the three stages that run once a row, in worker processes ---------------------------------


def _load(path: Path) -> tuple[trimesh.Trimesh, tuple[str, ...]]:
    mesh = meshes.repair_mesh(meshes.read_mesh(path))
    return mesh, meshes.check_mesh(mesh)


def _inspect(job: tuple[TableRow, str]) -> _Input:
    row, method = job
    try:
        mesh, warnings = _load(row.mesh)
        landmarks = None
        if method == "landmarks":
            if row.landmarks is None:
                raise InputError("the row has no landmarks file; alignment by landmarks needs one")
            landmarks = align.read_landmarks(row.landmarks)
        digest = hashlib.sha256(row.mesh.read_bytes()).hexdigest()
    except InputError as error:
        return _Input(reason=str(error))
    except Exception as error:  # one damaged mesh never stops the others, whatever is wrong with it
        return _Input(reason=f"{row.mesh.name} cannot be used ({error!r}); export it again")
    return _Input("", warnings, digest, float(mesh.volume), landmarks)


def _place(job: tuple[Alignment, Path, _Input]) -> _Placed:
    alignment, path, item = job
    if item.reason:
        return _Placed(item.reason)
    try:
        mesh, _ = _load(path)
        transform = align.rigid_transform(alignment, mesh, item.landmarks)
    except InputError as error:
        return _Placed(str(error))
    mesh.apply_transform(transform)
    return _Placed("", _nested(transform), _nested(mesh.bounds))


def _nested(array: NDArray[np.float64]) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(map(float, line)) for line in array)


def _write_samples(job: _Job) -> bool:
    """Sample one shape into its folder; false when the folder is already there."""
    o = job.options
    counts = dict(zip(store.KINDS, (o.surface_samples, o.near_samples, o.uniform_samples), strict=True))
    if store.is_whole(job.target, counts, job.frame.dim):
        return False
    shutil.rmtree(job.target, ignore_errors=True)
    mesh, _ = _load(job.mesh)
    mesh.apply_transform(np.array(job.transform))
    taken = samples.sample_shape(
        mesh, job.frame, o.surface_samples, o.near_samples, o.uniform_samples, job.seed
    )
    temporary = job.target.with_name(f".{job.target.name}.{os.getpid()}.tmp")
    shutil.rmtree(temporary, ignore_errors=True)
    temporary.mkdir()
    for kind in store.KINDS:
        np.save(temporary / f"{kind}.npy", getattr(taken, kind))
    mesh.export(temporary / store.MESH)
    try:
        temporary.rename(job.target)
    except OSError:  # another process was faster with the same content
        shutil.rmtree(temporary)
        return False
    return True


# --- what lies between the stages ---------------------------------------------------------------


def _usable(table: ShapeTable, placed: Sequence[_Placed]) -> list[int]:
    if usable := [i for i, item in enumerate(placed) if not item.reason]:
        return usable
    raise InputError(
        f"none of the {len(placed)} meshes can be used; row {table.rows[0].number}: {placed[0].reason}"
    )


def _common_frame(placed: Sequence[_Placed]) -> Frame:
    bounds_mm = np.array([item.bounds_mm for item in placed])
    return enclosing_frame(bounds_mm[:, 0].min(axis=0), bounds_mm[:, 1].max(axis=0))


def _reference(table: ShapeTable, inputs: Sequence[_Input], held_out: NDArray[np.bool_]) -> Alignment:
    """Complete the table's alignment with a reference made from usable training rows."""
    if table.alignment.method == "none":
        return table.alignment
    usable = [i for i, item in enumerate(inputs) if not item.reason and not held_out[i]]
    if not usable:
        reasons = [item.reason for item in inputs if item.reason]
        raise InputError(
            f"no training mesh can be used; the first reason: {(reasons or ['all held out'])[0]}"
        )
    if table.alignment.method == "landmarks":
        origin = table.alignment.origin
        complete = [
            marks for i in usable if (marks := inputs[i].landmarks) and (not origin or origin in marks)
        ]
        return align.landmark_alignment(complete, origin)
    # The shape of median volume is the least extreme one to move the others onto.
    middle = sorted(usable, key=lambda i: inputs[i].volume_mm3)[len(usable) // 2]
    return align.icp_alignment(_load(table.rows[middle].mesh)[0])


def _job(
    digest: str, placed: _Placed, row: TableRow, frame: Frame, options: PrepareOptions, out: Path
) -> _Job:
    """The fingerprint of a shape's samples names its folder and seeds its random numbers."""
    counts = [options.surface_samples, options.near_samples, options.uniform_samples]
    # Rounded to a nanometre, so that the last bits of another machine's arithmetic do not matter.
    transform = np.round(placed.transform, 9).tolist()
    key = [store.VERSION, digest, transform, frame.to_json(), counts, samples.NEAR_SIGMAS, options.seed]
    fingerprint = hashlib.sha256(json.dumps(key).encode()).hexdigest()
    target = out / store.SHAPES / fingerprint[:24]
    return _Job(row.mesh, placed.transform, frame, options, int(fingerprint[24:40], 16), target)


def _remove_strangers(folder: Path, known: set[str]) -> None:
    """Delete samples that the store no longer refers to, and what a killed run left half done.

    Only names that :func:`_job` and :func:`_write_samples` make: the user may keep other things here.
    """
    for path in folder.iterdir():
        if path.name not in known and _OWN_NAME.fullmatch(path.name):
            shutil.rmtree(path, ignore_errors=True)


# --- running the stages -------------------------------------------------------------------------

_Run = Callable[[Callable[[Any], Any], Sequence[Any], Progress | None], list[Any]]


@contextmanager
def _runner(workers: int | None, should_stop: Callable[[], bool] | None) -> Iterator[_Run]:
    """Yield ``run(function, jobs, progress) -> results in order``, in processes or in this one."""
    count = workers or _cores()
    if count == 1:
        yield lambda function, jobs, progress: _run_here(function, jobs, progress, should_stop)
        return
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(count, mp_context=context, initializer=_start_worker)
    try:
        yield lambda function, jobs, progress: _run_in(pool, function, jobs, progress, should_stop)
    except BrokenProcessPool as error:
        raise InputError(
            "a worker process died, most likely for lack of memory; run again with fewer workers"
        ) from error
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _cores() -> int:
    # Fewer than the machine has where a container or a batch system hands out a share.
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _start_worker() -> None:
    # One thread a worker: libigl would otherwise start one a core in each of them.
    os.environ["IGL_NUM_THREADS"] = "1"
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_leave_with, args=(parent,), daemon=True).start()


def _leave_with(parent: Any) -> None:
    """A killed parent cannot end its workers, and they would wait for work for ever."""
    parent.join()
    os._exit(1)


def _run_here(
    function: Callable[[Any], Any],
    jobs: Sequence[Any],
    progress: Progress | None,
    should_stop: Callable[[], bool] | None,
) -> list[Any]:
    results = []
    for job in jobs:
        _poll(should_stop)
        results.append(function(job))
        if progress is not None:
            progress(len(results) / len(jobs))
    return results


def _run_in(
    pool: ProcessPoolExecutor,
    function: Callable[[Any], Any],
    jobs: Sequence[Any],
    progress: Progress | None,
    should_stop: Callable[[], bool] | None,
) -> list[Any]:
    futures: list[Future[Any]] = [pool.submit(function, job) for job in jobs]
    pending = set(futures)
    while pending:
        _poll(should_stop)
        done, pending = wait(pending, timeout=0.2, return_when=FIRST_COMPLETED)
        for future in done:
            future.result()
        if progress is not None and done:
            progress(1 - len(pending) / len(futures))
    return [future.result() for future in futures]


def _poll(should_stop: Callable[[], bool] | None) -> None:
    if should_stop is not None and should_stop():
        raise Cancelled
