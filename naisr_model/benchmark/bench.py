"""How fast the program is on this machine, measured on an atlas and on networks of the paper's size.

A figure is a key, a unit, a definition and a target. A measurement gives one or more figures; each is
small and stands for itself, so that one that cannot be made here (no display, say) leaves a remark
instead of its figures.
"""

from __future__ import annotations

import json
import math
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from naisr_model import __version__, checkpoint
from naisr_model.atlas import Atlas
from naisr_model.benchmark.paper_size import paper_sized
from naisr_model.benchmark.plain import PlainNaisr, plain_loss
from naisr_model.config import PRESETS, Preset
from naisr_model.errors import Cancelled, InputError
from naisr_model.evaluation.reports import markdown_table
from naisr_model.learning.training.loop import accumulate_reconstruction
from naisr_model.learning.training.objective import Batch, latent_term
from naisr_model.models.naisr.network import Naisr
from naisr_model.surface.fields import shape_field
from naisr_model.surface.lattice import Lattice
from naisr_model.surface.sparse import Field, evaluate_band, evaluate_everywhere
from naisr_model.surface.tracking import Tracker

Figures = dict[str, float]

SAMPLE_RESOLUTION = 40
"""Cells along a side of the lattice on which the speed of the dense evaluation is measured."""

SUBPROCESS_SECONDS = 300.0


@dataclass(frozen=True)
class Scope:
    """How much is measured.

    Attributes:
        resolutions: for exact surfaces against dense ones; the first is also the one that is timed alone.
        growth: resolutions between which the growth of the evaluations is measured.
        memory: resolution of the surface whose memory is measured.
        repeats: runs behind every median.
        shapes: shapes in a training batch.
        training: networks and batch of the training step.
        frames: positions of a slider along its range.
        people: how many of the population's covariates the preview is compared at.
        viewer_runs: starts of the window, the first of which warms the file caches and fills the viewer's.
        enlarged: whether the atlas is measured at the paper's network size instead of its own.
    """

    resolutions: tuple[int, ...] = (128, 256)
    growth: tuple[int, int] = (64, 512)
    memory: int = 512
    repeats: int = 3
    shapes: int = 64
    training: Preset = PRESETS["paper-airway"]
    frames: int = 40
    people: int = 30
    viewer_runs: int = 3
    enlarged: bool = True


QUICK = Scope(
    resolutions=(32, 48),
    growth=(32, 64),
    memory=64,
    repeats=1,
    shapes=2,
    training=PRESETS["demo"],
    frames=3,
    people=3,
    viewer_runs=1,
    enlarged=False,
)
"""Enough to see that everything runs; its figures say little."""


@dataclass(frozen=True)
class Figure:
    """One number of the benchmark.

    Attributes:
        key: its name in the record.
        unit: of the number; empty for ratios and exponents.
        definition: what exactly is measured.
        at_least: the target, if more is better.
        at_most: the target, if less is better.
    """

    key: str
    unit: str
    definition: str
    at_least: float | None = None
    at_most: float | None = None

    @property
    def target(self) -> str:
        """The target in words, empty without one."""
        if self.at_least is not None:
            return f"≥ {self.at_least:g} {self.unit}".rstrip()
        return "" if self.at_most is None else f"≤ {self.at_most:g} {self.unit}".rstrip()

    def verdict(self, value: float) -> str:
        """Whether the target is met: yes, no, or empty without a target."""
        if self.at_least is None and self.at_most is None:
            return ""
        low = -math.inf if self.at_least is None else self.at_least
        high = math.inf if self.at_most is None else self.at_most
        return "yes" if low <= value <= high else "no"


@dataclass(frozen=True, eq=False)
class Subject:
    """What is measured.

    Attributes:
        path: the atlas's file.
        atlas: as it is.
        scope: how much.
        should_stop: polled between the parts of a measurement.
    """

    path: Path
    atlas: Atlas
    scope: Scope
    should_stop: Callable[[], bool] | None = None

    @cached_property
    def sized(self) -> Atlas:
        """The same atlas at the network size that is measured."""
        return paper_sized(self.atlas) if self.scope.enlarged else self.atlas

    @cached_property
    def people(self) -> NDArray[np.intp]:
        """Rows of the training population, evenly spaced."""
        rows = np.flatnonzero(~self.atlas.population.held_out)
        return rows[np.unique(np.linspace(0, len(rows) - 1, self.scope.people).astype(int))]

    def check(self) -> None:
        """Raise Cancelled when the user asked to stop."""
        if self.should_stop is not None and self.should_stop():
            raise Cancelled


Measurement = Callable[[Subject], Figures]


def bench(
    path: Path,
    scope: Scope,
    *,
    device: str = "cpu",
    progress: Callable[[float], None] | None = None,
    should_stop: Callable[[], bool] | None = None,
) -> dict[str, Any]:
    """Measure the atlas at ``path``.

    Args:
        path: a ``.safetensors`` file of 3D shapes.
        scope: how much to measure.
        device: where networks are evaluated and trained.
        progress: told the finished share.
        should_stop: polled between the parts of a measurement.

    Returns:
        Plain JSON types: one entry a figure by its key, ``machine``, ``versions``, ``atlas``,
        ``definitions`` and ``targets`` by key, and ``remarks`` on what could not be measured.

    Raises:
        InputError: when the atlas cannot be read or is not of 3D shapes, or torch cannot compute on the
            device.
        Cancelled: when ``should_stop()`` turned true.
    """
    subject = Subject(path, Atlas.load(path, device), scope, should_stop)
    if subject.atlas.frame.dim != 3:
        raise InputError("only atlases of 3D shapes are measured; give another one")
    measured: Figures = {}
    remarks = []
    for done, measurement in enumerate(MEASUREMENTS, start=1):
        subject.check()
        try:
            measured |= measurement(subject)
        except Impossible as reason:
            remarks.append(str(reason))
        if progress is not None:
            progress(done / len(MEASUREMENTS))
    known = [figure for figure in figures(scope) if figure.key in measured]
    return {
        **{figure.key: measured[figure.key] for figure in known},
        "atlas": subject.atlas.name,
        "device": device,
        "machine": machine(),
        "versions": versions(),
        "definitions": {figure.key: figure.definition for figure in known},
        "targets": {figure.key: figure.target for figure in known if figure.target},
        "remarks": remarks,
    }


def markdown(record: Mapping[str, Any], scope: Scope) -> str:
    """The record of :func:`bench` as a Markdown table with definitions."""
    known = [figure for figure in figures(scope) if figure.key in record]
    rows = [
        [f.key, f"{record[f.key]:.4g} {f.unit}".rstrip(), f.target, f.verdict(record[f.key])] for f in known
    ]
    hardware, software = record["machine"], record["versions"]
    lines = [
        markdown_table(["figure", "measured", "target", "met"], rows),
        "\n".join(f"- {figure.key}: {figure.definition}." for figure in known),
        f"Atlas {record['atlas']}; {hardware['processor']}, {hardware['cores']} cores, "
        f"{hardware['memory_gb']:.0f} GB, {hardware['system']}; "
        + ", ".join(f"{name} {version}" for name, version in software.items())
        + f"; networks on {record['device']}, {torch.get_num_threads()} threads; "
        f"medians of {scope.repeats} runs.",
        *record["remarks"],
    ]
    return "\n\n".join(lines) + "\n"


def figures(scope: Scope) -> tuple[Figure, ...]:
    """Every figure that a benchmark of this scope may hold, in the order of the table."""
    (low, high), first = scope.growth, scope.resolutions[0]
    size = "the paper's network size" if scope.enlarged else "the atlas's own network size"
    dense = "its speed is measured on a small lattice over the same box and scaled by the number of nodes"
    speedups = {128: 25.0, 256: 60.0}
    return (
        *(
            Figure(
                f"exact_speedup_{n}",
                "",
                f"time of evaluating a shape at all {n}³ cells' nodes over that of evaluate_band, at "
                f"{size}, median over people; the dense one is not run in full: {dense}",
                at_least=speedups.get(n),
            )
            for n in scope.resolutions
        ),
        Figure(
            f"exact_{first}_s",
            "s",
            f"from covariates and code to the mesh of a full shape at {first}³, at {size}",
        ),
        Figure(
            "evaluation_growth_exponent",
            "",
            f"log(evaluations at {high}³ / evaluations at {low}³) / log({high} / {low}) of evaluate_band",
            at_most=2.2,
        ),
        Figure(
            f"peak_memory_{scope.memory}_mb",
            "MB",
            f"most memory that a fresh process held resident while it made one mesh at {scope.memory}³, "
            f"the interpreter and libraries included, at {size}",
            at_most=2000.0 if scope.memory == 512 else None,
        ),
        Figure(
            "drag_p95_ms",
            "ms",
            "95th percentile of the time in which the full shape and the dragged covariate's own are "
            "carried to the next position of a slider, each slider there and back over its range",
            at_most=33.0,
        ),
        Figure(
            "drag_mean_voxels",
            "voxels",
            "mean distance, to first order, of the preview's vertices from the exact surface, in voxels "
            "of 128³; full shapes and single effects at the covariates of people of the population",
            at_most=0.25,
        ),
        Figure(
            "drag_p99_voxels",
            "voxels",
            "99th percentile of the same distances",
            at_most=1.0,
        ),
        Figure(
            "drag_flagged_share",
            "",
            "share of those previews that the tracker itself calls untrustworthy",
        ),
        Figure(
            "table_build_s",
            "s",
            f"tabulating every displacement of one code, at {size}",
            at_most=4.0,
        ),
        Figure(
            "train_speedup",
            "",
            f"training step (forward, losses, backward, Adam) of {scope.shapes} shapes of "
            f"{scope.training.training.shape_points} points: points per second over those of a plain "
            f"implementation of the paper's equations, alternating",
            at_least=2.0,
        ),
        Figure("train_points_per_s", "points/s", "points per second of that step"),
        Figure(
            "event_to_picture_p95_ms",
            "ms",
            "95th percentile from a change of a slider to a painted window with its value or a later one, "
            f"all views, at {size}",
            at_most=90.0,
        ),
        Figure("release_to_exact_s", "s", "from the release of the mouse to all views exact", at_most=1.5),
        Figure("window_visible_s", "s", "from the start of the process to a painted window", at_most=1.5),
        Figure(
            "first_picture_s",
            "s",
            "from the start of the process to all views exact, of an atlas that was open before",
            at_most=4.0,
        ),
        Figure("frames_dropped_share", "", "share of the slider's positions that a newer one overtook"),
    )


class Impossible(Exception):
    """What cannot be measured here, and why, as a sentence."""


def _timed(run: Callable[[], object]) -> float:
    """Seconds that ``run`` takes, to the end of what it leaves an accelerator to do."""
    start = time.perf_counter()
    run()
    if torch.accelerator.is_available():
        torch.accelerator.synchronize()
    return time.perf_counter() - start


# --- exact surfaces ------------------------------------------------------------------------------


def _field(atlas: Atlas, row: int) -> Field:
    """The full shape of one person of the training population."""
    vector = torch.as_tensor(atlas.population.normalised()[row], dtype=torch.float32)
    network = atlas.checkpoint.network().to(atlas.device)
    return shape_field(network, vector, torch.as_tensor(_latent(atlas, row)))


def _exact(subject: Subject) -> Figures:
    """Sparse against dense, and one mesh from end to end."""
    fields = [_field(subject.sized, row) for row in _few(subject)]
    fields[0](np.zeros((SAMPLE_RESOLUTION, 3), np.float32))
    found = {
        f"exact_speedup_{n}": statistics.median(_speedup(field, n, subject) for field in fields)
        for n in subject.scope.resolutions
    }
    resolution = subject.scope.resolutions[0]
    people = [(subject.atlas.population.row(row), _latent(subject.sized, row)) for row in _few(subject)]
    times = [_timed(partial(subject.sized.shape, *person, resolution)) for person in people]
    return found | {f"exact_{resolution}_s": statistics.median(times)}


def _few(subject: Subject) -> list[int]:
    """As many people as runs are to be made, from one end of the population to the other."""
    chosen = np.linspace(0, len(subject.people) - 1, subject.scope.repeats + 2).astype(int)[1:-1]
    return [int(row) for row in subject.people[chosen]]


def _latent(atlas: Atlas, row: int) -> NDArray[np.float32]:
    return atlas.checkpoint.latents[np.flatnonzero(~atlas.population.held_out).tolist().index(row)]


def _speedup(field: Field, resolution: int, subject: Subject) -> float:
    """Time of the dense evaluation, scaled up from a sample, over that of the sparse one."""
    sample, lattice = Lattice(SAMPLE_RESOLUTION), Lattice(resolution)
    share = math.prod(lattice.shape) / math.prod(sample.shape)
    dense = share * _timed(partial(evaluate_everywhere, field, sample))
    return dense / _timed(partial(evaluate_band, field, lattice, None, subject.should_stop))


def _growth(subject: Subject) -> Figures:
    """Counted on the atlas's own networks: the field and therefore the counts are the same."""
    field = _field(subject.atlas, _few(subject)[0])
    low, high = subject.scope.growth
    ratio = evaluations(field, high) / evaluations(field, low)
    return {"evaluation_growth_exponent": math.log(ratio) / math.log(high / low)}


def evaluations(field: Field, resolution: int) -> int:
    """How often ``evaluate_band`` asks for the field."""
    asked = 0

    def counting(points: NDArray[np.float32]) -> NDArray[np.float32]:
        nonlocal asked
        asked += len(points)
        return field(points)

    evaluate_band(counting, Lattice(resolution))
    return asked


def _memory(subject: Subject) -> Figures:
    resolution = subject.scope.memory
    device, enlarged = str(subject.atlas.device), subject.scope.enlarged
    call = f"mesh_and_report({str(subject.path)!r}, {resolution}, {device!r}, enlarged={enlarged})"
    command = f"from {__name__} import mesh_and_report; {call}"
    told = _told([sys.executable, "-c", command], "the memory")
    return {f"peak_memory_{resolution}_mb": float(told.split()[-1])}


def mesh_and_report(path: str, resolution: int, device: str, *, enlarged: bool) -> None:
    """Make one mesh, at the paper's network size or the atlas's own; print the peak memory in MB."""
    import resource

    atlas = Atlas.load(path, device)
    (paper_sized(atlas) if enlarged else atlas).shape({}, resolution=resolution)
    unit = 1 if sys.platform == "darwin" else 1024
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6)


def _told(command: Sequence[str], what: str) -> str:
    """Standard output of a process that measures something."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=SUBPROCESS_SECONDS, check=True)
    except subprocess.CalledProcessError as error:
        reason = (error.stderr.strip().splitlines() or ["it said nothing"])[-1]
        raise Impossible(f"Not measured: {what}; {reason}.") from error
    except (OSError, subprocess.TimeoutExpired) as error:
        raise Impossible(f"Not measured: {what}; {error}.") from error
    return done.stdout


# --- dragging ------------------------------------------------------------------------------------


def _drag(subject: Subject) -> Figures:
    """Tables, the time a slider takes, and how far the preview is from the exact surface."""
    template = subject.atlas.template(subject.scope.resolutions[0])
    times = [
        _timed(partial(subject.sized.tabulate, template, should_stop=subject.should_stop))
        for _ in range(subject.scope.repeats)
    ]
    tracker = subject.atlas.tracker(template, subject.atlas.tabulate(template))
    waits = [
        seconds
        for covariate in subject.atlas.covariates
        for seconds in _waits(
            subject, tracker, covariate.name, np.linspace(*covariate.range, subject.scope.frames)
        )
    ]
    errors, flagged = _preview_errors(subject, tracker)
    return {
        "table_build_s": statistics.median(times),
        "drag_p95_ms": 1000 * float(np.percentile(waits, 95)),
        "drag_mean_voxels": float(errors.mean()),
        "drag_p99_voxels": float(np.percentile(errors, 99)),
        "drag_flagged_share": float(flagged),
    }


def _waits(subject: Subject, tracker: Tracker, name: str, values: NDArray[np.float64]) -> Iterator[float]:
    """Seconds of every frame while a slider moves there and back; the others stand where somebody is."""
    others = subject.atlas.population.row(_few(subject)[0])
    full, single = tracker.track(others | {name: values[0]}), tracker.track({name: values[0]})
    for value in np.concatenate([values[1:], values[-2::-1]]).tolist():
        subject.check()
        start = time.perf_counter()
        full, single = tracker.track(others | {name: value}, full), tracker.track({name: value}, single)
        yield time.perf_counter() - start


def _preview_errors(subject: Subject, tracker: Tracker) -> tuple[NDArray[np.float64], float]:
    """Distances in voxels of 128^3 of all vertices, and the share of previews that are flagged."""
    voxel_mm = 2 * subject.atlas.frame.scale_mm / 128
    errors, trusted = [], []
    for row in subject.people:
        subject.check()
        values = subject.atlas.population.row(int(row))
        for shown in (values, *({name: value} for name, value in values.items())):
            tracked = tracker.track(shown)
            errors.append(np.abs(subject.atlas.sdf(tracked.points_mm, shown)) / voxel_mm)
            trusted.append(tracked.is_trustworthy)
    return np.concatenate(errors), 1 - statistics.mean(trusted)


# --- training ------------------------------------------------------------------------------------


def _training(subject: Subject) -> Figures:
    """Steps of the fast and of the plain implementation in turn, from the same weights."""
    scope, device = subject.scope, subject.atlas.device
    with torch.random.fork_rng():
        torch.manual_seed(0)
        network = Naisr(scope.training.network, covariates=3).to(device)
        batch = Batch(*(part.to(device) for part in _random_batch(scope)))
        covariates = torch.randn(scope.shapes, 3).to(device)
        codes = 0.01 * torch.randn(scope.shapes, scope.training.network.latent).to(device)
    plain = PlainNaisr(network)
    weights = PRESETS["paper-airway"].training.loss

    def fast_loss(latents: Tensor) -> None:
        accumulate_reconstruction(network, batch, covariates, latents, weights)
        latent_term(latents, weights)["latent"].backward()

    def slow_loss(latents: Tensor) -> None:
        plain_loss(plain, batch, covariates, latents, weights).backward()

    steps = _step(network, codes, fast_loss), _step(plain, codes, slow_loss)
    times = []
    for _ in range(scope.repeats + 1):  # the first one warms up
        subject.check()
        times.append([_timed(step) for step in steps])
    fast, slow = np.median(times[1:], axis=0)
    points = scope.shapes * scope.training.training.shape_points
    return {"train_speedup": float(slow / fast), "train_points_per_s": float(points / fast)}


def _random_batch(scope: Scope) -> Batch:
    """Points and normals anywhere: a step takes as long as with real ones."""
    training, dim = scope.training.training, scope.training.network.dim
    on, off = training.surface_points, training.near_points + training.uniform_points
    normals = torch.nn.functional.normalize(torch.randn(scope.shapes, on, dim), dim=-1)
    surface, space = (2 * torch.rand(scope.shapes, count, dim) - 1 for count in (on, off))
    return Batch(surface, normals, space, torch.rand(scope.shapes, off) - 0.5)


def _step(network: torch.nn.Module, codes: Tensor, backward: Callable[[Tensor], None]) -> Callable[[], None]:
    """One training step of Adam on the weights and on a copy of the codes."""
    latents = codes.clone().requires_grad_()
    optimiser = torch.optim.Adam([*network.parameters(), latents], lr=5e-5)

    def step() -> None:
        optimiser.zero_grad()
        backward(latents)
        optimiser.step()

    return step


# --- the window ----------------------------------------------------------------------------------

WINDOW = ("event_to_picture_p95_ms", "release_to_exact_s", "window_visible_s", "first_picture_s")


def window(subject: Subject) -> Figures:
    """What the viewer measures of itself, in processes of its own."""
    with tempfile.TemporaryDirectory() as folder:
        atlas, file = Path(folder) / "atlas.safetensors", Path(folder) / "figures.json"
        checkpoint.save(atlas, subject.sized.checkpoint)
        device = str(subject.atlas.device)
        runs = [watched(atlas, file, device) for _ in range(subject.scope.viewer_runs)]
    shares = [run["frames_dropped"] / run["events"] for run in runs]
    return {
        **{key: float(statistics.median(run[key] for run in runs)) for key in WINDOW},
        "frames_dropped_share": statistics.median(shares),
    }


def watched(atlas: Path, file: Path, device: str) -> dict[str, Any]:
    """What the viewer writes to ``file`` about itself; Impossible where it cannot run."""
    command = [sys.executable, "-m", "naisr_viewer", str(atlas), "--measure", str(file), "--device", device]
    _told(command, "the window")
    return json.loads(file.read_text(encoding="utf-8"))


MEASUREMENTS: tuple[Measurement, ...] = (_exact, _growth, _memory, _drag, _training, window)


# --- the machine ---------------------------------------------------------------------------------


def machine() -> dict[str, Any]:
    """What this was measured on: ``processor``, ``cores``, ``memory_gb`` and ``system``."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "memory_gb": _memory_bytes() / 2**30,
        "system": platform.platform(),
    }


def versions() -> dict[str, str]:
    """Versions of everything that has a say in the figures."""
    packages = {"torch": "torch", "vtk": "vtk", "pyvista": "pyvista", "PySide6": "PySide6-Essentials"}
    return {
        "naisr": __version__,
        "python": platform.python_version(),
        **{name: metadata.version(package) for name, package in packages.items()},
    }


def _processor() -> str:
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text().splitlines() if cpuinfo.exists() else []
    named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(named, platform.processor() or platform.machine())


def _memory_bytes() -> float:
    try:
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, ValueError):
        return math.nan
