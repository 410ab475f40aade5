"""The ``naisr`` command: argument parsing only; each command calls one function of the library."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import math
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import App, CycloptsError, Parameter
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from naisr_model import __version__
from naisr_model.errors import Cancelled, InputError

app = App(
    name="naisr",
    version=__version__,
    help="Shape atlases that explain: prepare data, train, inspect, evaluate and export.",
)
_console = Console(stderr=True)


@app.command
def populate(name: str, out: Path, *, patients: int | None = None, seed: int = 0) -> None:
    """Write a synthetic population (meshes, landmarks, CSV) as a hospital would hand it over.

    Args:
        name: airway or bodies.
        out: folder to write into.
        patients: how many patients; left out, the population's own number.
        seed: the same seed gives the same files.
    """
    from naisr_model.data.populations import population

    size = {} if patients is None else {"patients": patients}
    with _bar(f"writing {name}") as progress, _stoppable() as stop:
        table = population(name).write_population(out, seed=seed, progress=progress, should_stop=stop, **size)
    print(table)


@app.command
def prepare(
    table: Path,
    *,
    out: Path,
    surface_samples: int = 100_000,
    near_samples: int = 400_000,
    uniform_samples: int = 100_000,
    held_out: float = 0.2,
    seed: int = 0,
    workers: int | None = None,
) -> None:
    """Turn a CSV of meshes and covariates into a store of samples to train on.

    A run that was stopped goes on where it was. Meshes that cannot be used are listed with the
    reason and left out.

    Args:
        table: CSV with the columns mesh, subject, visit, then covariates; a TOML file of the same
            name beside it may set units, kinds and the alignment.
        out: folder of the store.
        surface_samples: points with normals on each surface.
        near_samples: signed distances close to each surface.
        uniform_samples: signed distances anywhere in the box.
        held_out: share of the subjects kept for evaluation.
        seed: of the split and of the samples.
        workers: processes; left out, one a core.
    """
    from naisr_model.data.prepare import PrepareOptions
    from naisr_model.data.prepare import prepare as run

    options = PrepareOptions(surface_samples, near_samples, uniform_samples, held_out, seed, workers)
    with _bar("preparing") as progress, _stoppable() as stop:
        report = run(table, out, options=options, progress=progress, should_stop=stop)
    for remark in report.rejected:
        print(f"rejected {remark.path} (row {remark.row}): {remark.reason}")
    for remark in report.warnings:
        print(f"warning {remark.path} (row {remark.row}): {remark.reason}")
    print(
        f"{len(report.accepted)} shapes in {out} ({len(report.skipped)} were there already), "
        f"{len(report.rejected)} rejected"
    )


@app.command
def train(
    store: Path,
    *,
    out: Path,
    preset: str = "demo",
    config: Path | None = None,
    epochs: int | None = None,
    time_budget: Annotated[str | None, Parameter(help="as 90s, 45m or 1.5h")] = None,
    seed: int | None = None,
    device: str = "cpu",
) -> None:
    """Train an atlas; stop it whenever you like, the same command goes on.

    OUT can be opened from the first minute on; OUT.training/ beside it keeps the state to resume
    from, a TensorBoard log and the template at chosen epochs.

    Args:
        store: made by 'naisr prepare'.
        out: the .safetensors file to write.
        preset: demo (two CPU cores), paper-airway, paper-hippocampus or paper-starman.
        config: a TOML file with settings on top of the preset.
        epochs: passes over the training shapes.
        time_budget: train for about so long.
        seed: of the initial weights and of every draw.
        device: cpu, cuda or mps.
    """
    from naisr_model.config import preset as named
    from naisr_model.config import read_toml
    from naisr_model.data.store import SampleStore
    from naisr_model.learning.train import train as run

    budget = math.inf if time_budget is None else _seconds(time_budget)
    chosen = named(preset) if config is None else read_toml(config, named(preset))
    changes: dict[str, Any] = {"epochs": epochs, "seed": seed}
    training = dataclasses.replace(chosen.training, **{k: v for k, v in changes.items() if v is not None})
    with _training_bar() as report, _stoppable() as stop:
        checkpoint = run(
            SampleStore.open(store),
            dataclasses.replace(chosen, training=training),
            out,
            time_budget_s=budget,
            report=report,
            should_stop=stop,
            device=device,
        )
    print(f"{out} after {checkpoint.training['iterations']} iterations")
    if "folded_share" in checkpoint.training:
        print(f"folded points near the surface: {100 * checkpoint.training['folded_share']:.2f} %")


@app.command
def mesh(
    atlas: Path,
    out: Path,
    *,
    set: Annotated[
        list[str] | None, Parameter(name="--set", negative=(), help="covariate, as age=120")
    ] = None,
    effect: str | None = None,
    template: bool = False,
    resolution: int = 128,
    extrapolate: bool = False,
    device: str = "cpu",
) -> None:
    """Write one surface of an atlas in millimetres (STL, PLY, OBJ or GLB by the file's name).

    Args:
        atlas: the .safetensors file.
        out: the mesh to write.
        set: covariate values in real units; the others are at the population centre.
        effect: the covariate whose disentangled shape is wanted instead of the full shape.
        template: write the template.
        resolution: cells along a side of the box, a multiple of 8.
        extrapolate: allow values outside the observed range.
        device: where the networks are evaluated: cpu, cuda or mps.
    """
    from naisr_model.atlas import Atlas
    from naisr_model.files import replacing

    if out.suffix.lower() not in (".stl", ".ply", ".obj", ".glb"):
        raise InputError(f"cannot write '{out.suffix}'; name the file .stl, .ply, .obj or .glb")
    if template and (effect is not None or set):
        raise InputError("the template depends on no covariate; leave out --effect and --set")
    loaded = Atlas.load(atlas, device)
    values = _values(loaded, set or [])
    if template:
        surface = loaded.template(resolution)
    elif effect is not None:
        if values.keys() != {effect}:
            raise InputError(f"--effect {effect} needs its value and no other, as --set {effect}=VALUE")
        surface = loaded.effect(effect, values[effect], None, resolution, extrapolate=extrapolate)
    else:
        surface = loaded.shape(values, None, resolution, extrapolate=extrapolate)
    if not len(surface.faces):
        raise InputError("there is no surface at these covariates; choose values nearer to the data")
    with replacing(out) as temporary:
        surface.export(temporary)
    print(f"{out}: {len(surface.faces)} faces, {surface.volume / 1000:.2f} cm³")


@Parameter(name="*")
@dataclasses.dataclass(frozen=True)
class _Reading:
    """How a patient's file is read.

    Attributes:
        known: covariates of the scan, as age=84,weight=20.4,sex=M; the others are inferred.
        label: which label of a volume, its number or its name.
        scale: millimetres per unit of the file; left out, it is guessed where the size is implausible.
        align: none, icp or landmarks; onto the atlas's shape at the known covariates.
        landmarks: CSV name,x,y,z in the coordinates of the file.
    """

    known: str = ""
    label: str | None = None
    scale: float | None = None
    align: Literal["none", "icp", "landmarks"] = "none"
    landmarks: Path | None = None


_AS_IT_IS = _Reading()


@app.command
def fit(
    patient: Path,
    *,
    atlas: Path,
    reading: _Reading = _AS_IT_IS,
    out: Path | None = None,
    json_file: Annotated[Path | None, Parameter(name="--json")] = None,
) -> None:
    """Fit a patient's shape: covariates that are not given are inferred, all with 95 % intervals.

    Args:
        patient: a mesh, whole or in part, a label volume or a cloud of points.
        atlas: the .safetensors file.
        reading: how the file is read.
        out: folder for the fitted surface, a table and a picture.
        json_file: also write the figures to this file.
    """
    from naisr_model.evaluation.evolution import fit_record, write_series

    fitted, intake = _fitted(patient, atlas, reading)
    record = fit_record(fitted)
    for covariate in fitted.individual.atlas.covariates:
        name, interval = covariate.name, ""
        if name in fitted.intervals:
            low, high = (covariate.format(value) for value in fitted.intervals[name])
            interval = f" ({low})" if low == high else f" ({low} to {high})"
        print(f"{name}: {covariate.format(fitted.covariates[name])}{interval}")
    for other in record["alternatives"][1:]:
        print(f"or, with a probability of {other['probability']:.0%}: {other['covariates']}")
    low, high = fitted.volume_interval_cm3
    print(f"volume: {fitted.volume_cm3:.1f} cm³ ({low:.1f} to {high:.1f})")
    print(f"residual: {fitted.residual_mm:.2f} mm, {fitted.seconds:.1f} s")
    for sentence in fitted.remarks:
        print(sentence)
    if out is not None:
        write_series(out, [fitted.individual])
    _write_json(json_file, {"patient": intake.to_json(), **record})


@app.command
def transfer(
    patient: Path,
    *,
    atlas: Path,
    to: Annotated[str, Parameter(help="covariates to show the patient at, as age=120,weight=28.5")],
    reading: _Reading = _AS_IT_IS,
    out: Path | None = None,
    json_file: Annotated[Path | None, Parameter(name="--json")] = None,
) -> None:
    """Show a patient's shape at other covariates, what makes the patient an individual kept.

    Args:
        patient: a mesh, whole or in part, a label volume or a cloud of points.
        atlas: the .safetensors file.
        to: the others stay as they are.
        reading: how the file is read.
        out: folder for both surfaces, a table and a picture.
        json_file: also write the figures to this file.
    """
    from naisr_model.evaluation.evolution import parsed

    fitted, intake = _fitted(patient, atlas, reading)
    moved = fitted.at(parsed(fitted.individual.atlas, _pairs("--to", to)))
    _tell_series(intake, [fitted.individual, moved], out, json_file)


@app.command
def evolve(
    patient: Path,
    *,
    atlas: Path,
    reading: _Reading = _AS_IT_IS,
    along: str = "age",
    start: Annotated[float | None, Parameter(name="--from")] = None,
    stop: Annotated[float | None, Parameter(name="--to")] = None,
    steps: int = 6,
    path: str = "population",
    out: Path | None = None,
    json_file: Annotated[Path | None, Parameter(name="--json")] = None,
) -> None:
    """Follow a patient's shape along one covariate.

    Args:
        patient: a mesh, whole or in part, a label volume or a cloud of points.
        atlas: the .safetensors file.
        reading: how the file is read.
        along: the covariate that moves.
        start: its first value; left out, the patient's.
        stop: its last value; left out, the largest observed one.
        steps: shapes on the way, both ends included.
        path: population (the others grow as usual), only (the effect of this covariate by itself), or
            a CSV whose header names covariates, a row for each step.
        out: folder for the surfaces, a table and a picture.
        json_file: also write the figures to this file.
    """
    from naisr_model.evaluation.evolution import evolution

    fitted, intake = _fitted(patient, atlas, reading)
    _tell_series(intake, evolution(fitted, along, start, stop, steps, path), out, json_file)


def _fitted(patient: Path, atlas: Path, reading: _Reading) -> tuple[Any, Any]:
    """The fit, and how the file was brought into the frame of the atlas."""
    from naisr_model.atlas import Atlas
    from naisr_model.evaluation.evolution import parsed
    from naisr_model.evaluation.intake import take_in

    loaded = Atlas.load(atlas)
    options = dataclasses.asdict(reading)
    known = parsed(loaded, _pairs("--known", options.pop("known")))
    with _stoppable() as stop:
        intake = take_in(patient, loaded, known, **options, should_stop=stop)
    for sentence in intake.sentences:
        print(f"naisr: {sentence}", file=sys.stderr)
    with _bar("fitting") as progress, _stoppable() as stop:
        fitted = loaded.fit(intake.patient.mesh_mm, known, progress=progress, should_stop=stop)
    return fitted, intake


def _tell_series(intake: Any, people: Sequence[Any], out: Path | None, json_file: Path | None) -> None:
    from naisr_model.evaluation.evolution import write_series

    with _bar("measuring") as progress, _stoppable() as stop:
        records = write_series(out, people, progress=progress, should_stop=stop)
    for person, record in zip(people, records, strict=True):
        where = ", ".join(c.format(person.covariates[c.name]) for c in person.atlas.covariates)
        low, high = record["volume_low_cm3"], record["volume_high_cm3"]
        print(f"{where}: {record['volume_cm3']:.1f} cm³ ({low:.1f} to {high:.1f})")
    _write_json(json_file, {"patient": intake.to_json(), "shapes": records})


def _write_json(path: Path | None, record: object) -> None:
    from naisr_model.files import replacing

    if path is not None:
        with replacing(path) as temporary:
            temporary.write_text(json.dumps(record, indent=1), encoding="utf-8")


def _pairs(option: str, text: str) -> dict[str, str]:
    """``age=84,sex=M`` as names and texts."""
    pairs = [part.partition("=") for part in text.split(",") if part.strip()]
    if wrong := [name for name, equals, _ in pairs if not equals]:
        raise InputError(f"'{wrong[0]}' after {option} is not understood; write NAME=VALUE,NAME=VALUE")
    return {name.strip(): value for name, _, value in pairs}


@app.command
def info(atlas: Path) -> None:
    """Show what an atlas is made of."""
    from naisr_model.checkpoint import load

    checkpoint = load(atlas)
    population = checkpoint.population
    held_out = int(population.held_out.sum())
    weights = sum(tensor.numel() for tensor in checkpoint.weights.values())
    print(
        f"{checkpoint.name}: {len(population)} shapes of {len(set(population.subjects))} subjects, ", end=""
    )
    print(f"{held_out} shapes held out")
    for covariate in population.covariates:
        low, high = (covariate.format(value) for value in covariate.range)
        print(f"  {covariate.name}: {low} to {high}, centre {covariate.format(covariate.centre)}")
    print(f"networks: {weights:,} weights, latent code of {checkpoint.preset.network.latent}")
    print(f"box: {2 * checkpoint.frame.scale_mm:.0f} mm wide, alignment by {checkpoint.alignment.method}")
    for key, value in {**checkpoint.source, **checkpoint.training}.items():
        print(f"{key}: {value}")


evaluate = App(name="evaluate", help="Measure how good an atlas is.")
app.command(evaluate)


@evaluate.command
def reconstruction(
    atlas: Path,
    *,
    store: Path | None = None,
    json_file: Annotated[Path | None, Parameter(name="--json")] = None,
    limit: int = 0,
) -> None:
    """Refit the held-out shapes, covariates given and inferred, and check effects where the truth is known.

    Args:
        atlas: the .safetensors file.
        store: where its held-out shapes are; not needed for the synthetic populations, which are
            made again from their seed.
        json_file: also write the figures to this file.
        limit: at most so many held-out shapes; 0 takes all.
    """
    from naisr_model.evaluation.reconstruction import EvaluationConfig
    from naisr_model.evaluation.reconstruction import evaluate as run
    from naisr_model.evaluation.tables import PUBLISHED_AIRWAY, reconstruction_markdown

    _require_at_least("--limit", limit, 0)
    loaded, samples = _with_store(atlas, store)
    with _bar("evaluating") as progress, _stoppable() as stop:
        report = run(loaded, EvaluationConfig(limit=limit), samples, progress=progress, should_stop=stop)
    print(reconstruction_markdown(report, PUBLISHED_AIRWAY if loaded.name == "airway" else ()))
    _write_json(json_file, report)


@evaluate.command(name="transfer")
def transferring(
    atlas: Path,
    *,
    store: Path | None = None,
    json_file: Annotated[Path | None, Parameter(name="--json")] = None,
    limit: int = 0,
) -> None:
    """Fit held-out subjects once and predict them at other visits and other covariates.

    Args:
        atlas: the .safetensors file.
        store: where its held-out shapes are; not needed for the synthetic populations.
        json_file: also write the figures to this file.
        limit: at most so many subjects, those with most visits first; 0 takes all.
    """
    from naisr_model.evaluation.tables import PUBLISHED_AIRWAY_TRANSFER
    from naisr_model.evaluation.transfer import transfer as run
    from naisr_model.evaluation.transfer import transfer_markdown

    _require_at_least("--limit", limit, 0)
    loaded, samples = _with_store(atlas, store)
    with _bar("fitting") as progress, _stoppable() as stop:
        report = run(loaded, samples, limit or None, progress=progress, should_stop=stop)
    print(transfer_markdown(report, PUBLISHED_AIRWAY_TRANSFER if loaded.name == "airway" else ()))
    _write_json(json_file, report)


@evaluate.command
def completion(
    atlas: Path,
    *,
    store: Path | None = None,
    json_file: Annotated[Path | None, Parameter(name="--json")] = None,
    limit: int = 0,
) -> None:
    """Cut a third of each held-out surface away and measure how well a fit of the rest completes it.

    Args:
        atlas: the .safetensors file.
        store: where its held-out shapes are; not needed for the synthetic populations.
        json_file: also write the figures to this file.
        limit: at most so many held-out shapes; 0 takes all.
    """
    from naisr_model.evaluation.completion import completion as run
    from naisr_model.evaluation.completion import completion_markdown
    from naisr_model.evaluation.reconstruction import held_out_shapes

    _require_at_least("--limit", limit, 0)
    loaded, samples = _with_store(atlas, store)
    shapes = held_out_shapes(loaded, samples, limit or None)
    with _bar("fitting") as progress, _stoppable() as stop:
        report = run(loaded, shapes, progress=progress, should_stop=stop)
    print(completion_markdown(report))
    _write_json(json_file, report)


def _require_at_least(option: str, value: int, least: int) -> None:
    if value < least:
        raise InputError(f"{option} is {value}; give {least} or more")


def _with_store(atlas: Path, store: Path | None) -> tuple[Any, Any]:
    """An atlas, and the store of its held-out shapes where one was named."""
    from naisr_model.atlas import Atlas
    from naisr_model.data.store import SampleStore

    return Atlas.load(atlas), None if store is None else SampleStore.open(store)


@evaluate.command
def fitting(
    atlas: Path,
    *,
    store: Path | None = None,
    json_file: Annotated[Path | None, Parameter(name="--json")] = None,
    limit: int = 50,
) -> None:
    """Compare the fit with the paper's procedure on held-out shapes; the latter takes a minute a shape.

    Args:
        atlas: the .safetensors file.
        store: where its held-out shapes are; not needed for the synthetic populations.
        json_file: also write the figures to this file.
        limit: at most so many held-out shapes.
    """
    from naisr_model.config import FitConfig
    from naisr_model.evaluation.fitting import compare_fits, comparison_markdown
    from naisr_model.evaluation.reconstruction import held_out_shapes

    _require_at_least("--limit", limit, 1)
    loaded, samples = _with_store(atlas, store)
    shapes = held_out_shapes(loaded, samples, limit)
    with _bar("fitting") as progress, _stoppable() as stop:
        report = compare_fits(loaded, shapes, FitConfig(), progress=progress, should_stop=stop)
    print(comparison_markdown(report, FitConfig()))
    _write_json(json_file, report)


@evaluate.command
def calibration(
    atlas: Path,
    *,
    patients: int = 200,
    known: Annotated[str, Parameter(help="covariates that the fits are told, as age,sex")] = "",
    json_file: Annotated[Path | None, Parameter(name="--json")] = None,
) -> None:
    """Count how often the 95 % intervals of a fit hold the truth, over new synthetic patients.

    Args:
        atlas: the .safetensors file, of a synthetic population.
        patients: how many are made and fitted.
        known: the others are inferred.
        json_file: also write the figures to this file.
    """
    from naisr_model.atlas import Atlas
    from naisr_model.evaluation.calibration import calibration as run
    from naisr_model.evaluation.calibration import calibration_markdown

    _require_at_least("--patients", patients, 1)
    names = [name.strip() for name in known.split(",") if name.strip()]
    with _bar("fitting") as progress, _stoppable() as stop:
        report = run(Atlas.load(atlas), patients, names, progress=progress, should_stop=stop)
    print(calibration_markdown(report))
    _write_json(json_file, report)


@app.command
def bench(
    atlas: Path | None = None,
    *,
    json_file: Annotated[Path | None, Parameter(name="--json")] = None,
    quick: Annotated[bool, Parameter(negative=())] = False,
    device: str = "cpu",
) -> None:
    """Measure how fast everything is on this machine, at the paper's network size; takes some minutes.

    Args:
        atlas: the .safetensors file; left out, the airway atlas that comes with the program.
        json_file: also write the figures to this file.
        quick: see in less than a minute that everything runs; the figures then say little.
        device: where networks are evaluated and trained: cpu, cuda or mps.
    """
    from naisr_model.evaluation.bench import QUICK, Scope, default_atlas, markdown
    from naisr_model.evaluation.bench import bench as run

    scope = QUICK if quick else Scope()
    with _bar("measuring") as progress, _stoppable() as stop:
        record = run(atlas or default_atlas(), scope, device=device, progress=progress, should_stop=stop)
    print(markdown(record, scope))
    _write_json(json_file, record)


def _values(atlas: Any, settings: list[str]) -> dict[str, float]:
    known = {covariate.name: covariate for covariate in atlas.covariates}
    values = {}
    for setting in settings:
        name, equals, text = setting.partition("=")
        if not equals or name not in known:
            raise InputError(
                f"'--set {setting}' is not understood; write NAME=VALUE with one of {', '.join(known)}"
            )
        values[name] = known[name].parse(text)
    return values


def _seconds(text: str) -> float:
    factor = {"s": 1.0, "m": 60.0, "h": 3600.0}.get(text[-1:], 0.0)
    try:
        seconds = factor * float(text[:-1])
    except ValueError:
        seconds = 0.0
    if not 0 < seconds < math.inf:
        raise InputError(f"the time budget is '{text}'; write it as 90s, 45m or 1.5h")
    return seconds


@contextlib.contextmanager
def _bar(label: str) -> Iterator[Callable[[float], None]]:
    with Progress(
        TextColumn(label),
        BarColumn(),
        TextColumn("{task.percentage:.0f} %"),
        TimeRemainingColumn(),
        console=_console,
    ) as bar:
        task = bar.add_task(label, total=1.0)
        yield lambda share: bar.update(task, completed=share)


@contextlib.contextmanager
def _training_bar() -> Iterator[Callable[[Any], None]]:
    columns = (
        TextColumn("epoch {task.fields[epoch]}"),
        BarColumn(),
        TextColumn(
            "loss {task.fields[loss]:.3f}  {task.fields[speed]:,.0f} points/s  {task.fields[left]} left"
        ),
    )
    with Progress(*columns, console=_console) as bar:
        task = bar.add_task("training", total=1.0, epoch=0, loss=float("nan"), speed=0.0, left="?")

        def report(told: Any) -> None:
            minutes, seconds = divmod(int(told.seconds_left), 60)
            bar.update(
                task,
                completed=told.share,
                epoch=told.epoch,
                loss=told.losses["total"],
                speed=told.points_per_second,
                left=f"{minutes}:{seconds:02d}",
            )

        yield report


@contextlib.contextmanager
def _stoppable() -> Iterator[Callable[[], bool]]:
    """Ctrl+C asks for a clean end; a second one ends at once."""
    asked = False

    def ask(_signal: int, _frame: object) -> None:
        nonlocal asked
        if asked:
            raise KeyboardInterrupt
        asked = True

    previous = signal.signal(signal.SIGINT, ask)
    try:
        yield lambda: asked
    finally:
        signal.signal(signal.SIGINT, previous)


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point.

    Args:
        arguments: the words after ``naisr``; left out, those of the command line.

    Returns:
        0 on success, 2 for input that cannot be used, 130 when stopped by the user.
    """
    try:
        app(
            sys.argv[1:] if arguments is None else arguments,
            result_action="return_value",
            exit_on_error=False,
            print_error=False,
        )
    except (InputError, CycloptsError) as error:
        print(f"naisr: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"naisr: {error.strerror or error}: {error.filename or ''}", file=sys.stderr)
        return 2
    except (Cancelled, KeyboardInterrupt):
        print("naisr: stopped; what was finished is kept", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
