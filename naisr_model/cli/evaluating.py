"""Commands that measure: ``evaluate ...``, how good an atlas is, and ``bench``, how fast everything is."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, Parameter

from naisr_model.cli.console import bar, stoppable, write_json
from naisr_model.cli.options import AtlasFile, JsonFile, require_at_least
from naisr_model.shipped import shipped_atlas

evaluate = App(name="evaluate", help="Measure how good an atlas is.")

StoreFolder = Annotated[
    Path | None,
    Parameter(
        help="where its held-out shapes are; not needed for the synthetic populations, "
        "which are made again from their seed."
    ),
]
Limit = Annotated[int, Parameter(help="at most so many held-out shapes; 0 takes all.")]


@evaluate.command
def reconstruction(
    atlas: AtlasFile, *, store: StoreFolder = None, json_file: JsonFile = None, limit: Limit = 0
) -> None:
    """Refit the held-out shapes, covariates given and inferred; check effects where the truth is known."""
    from naisr_model.evaluation.reports import PUBLISHED_AIRWAY, reconstruction_markdown
    from naisr_model.evaluation.studies.reconstruction import EvaluationConfig
    from naisr_model.evaluation.studies.reconstruction import evaluate as run

    loaded, samples = _with_held_out(atlas, store, limit)
    published = PUBLISHED_AIRWAY if loaded.name == "airway" else ()
    _measure(
        "evaluating",
        partial(run, loaded, EvaluationConfig(limit=limit), samples),
        partial(reconstruction_markdown, published=published),
        json_file,
    )


@evaluate.command
def transfer(
    atlas: AtlasFile,
    *,
    store: StoreFolder = None,
    json_file: JsonFile = None,
    limit: Annotated[
        int, Parameter(help="at most so many subjects, those with most visits first; 0 takes all.")
    ] = 0,
) -> None:
    """Fit held-out subjects once and predict them at other visits and other covariates."""
    from naisr_model.evaluation.reports import PUBLISHED_AIRWAY_TRANSFER
    from naisr_model.evaluation.studies.transfer import transfer as run
    from naisr_model.evaluation.studies.transfer import transfer_markdown

    loaded, samples = _with_held_out(atlas, store, limit)
    published = PUBLISHED_AIRWAY_TRANSFER if loaded.name == "airway" else ()
    _measure(
        "fitting",
        partial(run, loaded, samples, limit or None),
        partial(transfer_markdown, published=published),
        json_file,
    )


@evaluate.command
def completion(
    atlas: AtlasFile, *, store: StoreFolder = None, json_file: JsonFile = None, limit: Limit = 0
) -> None:
    """Cut a third of each held-out surface away and measure how well a fit of the rest completes it."""
    from naisr_model.evaluation.studies.completion import completion as run
    from naisr_model.evaluation.studies.completion import completion_markdown
    from naisr_model.evaluation.studies.reconstruction import held_out_shapes

    loaded, samples = _with_held_out(atlas, store, limit)
    shapes = held_out_shapes(loaded, samples, limit or None)
    _measure("fitting", partial(run, loaded, shapes), completion_markdown, json_file)


@evaluate.command
def fitting(
    atlas: AtlasFile,
    *,
    store: StoreFolder = None,
    json_file: JsonFile = None,
    limit: Annotated[int, Parameter(help="at most so many held-out shapes.")] = 50,
) -> None:
    """Compare the fit with the paper's procedure on held-out shapes; the latter takes a minute a shape."""
    from naisr_model.config import FitConfig
    from naisr_model.evaluation.studies.fit_speed import compare_fits, comparison_markdown
    from naisr_model.evaluation.studies.reconstruction import held_out_shapes

    loaded, samples = _with_held_out(atlas, store, limit, least=1)
    shapes = held_out_shapes(loaded, samples, limit)
    config = FitConfig()
    _measure(
        "fitting",
        partial(compare_fits, loaded, shapes, config),
        partial(comparison_markdown, config=config),
        json_file,
    )


@evaluate.command
def calibration(
    atlas: Annotated[Path, Parameter(help="the .safetensors file, of a synthetic population.")],
    *,
    patients: Annotated[int, Parameter(help="how many are made and fitted.")] = 200,
    known: Annotated[
        str, Parameter(help="covariates that the fits are told, as age,sex; the others are inferred.")
    ] = "",
    json_file: JsonFile = None,
) -> None:
    """Count how often the 95 % intervals of a fit hold the truth, over new synthetic patients."""
    from naisr_model.atlas import Atlas
    from naisr_model.evaluation.studies.calibration import calibration as run
    from naisr_model.evaluation.studies.calibration import calibration_markdown

    require_at_least("--patients", patients, 1)
    names = [name.strip() for name in known.split(",") if name.strip()]
    _measure("fitting", partial(run, Atlas.load(atlas), patients, names), calibration_markdown, json_file)


def bench(
    atlas: Annotated[
        Path | None,
        Parameter(help="the .safetensors file; left out, the airway atlas that comes with the program."),
    ] = None,
    *,
    json_file: JsonFile = None,
    quick: Annotated[
        bool,
        Parameter(
            negative=(), help="see in less than a minute that everything runs; the figures then say little."
        ),
    ] = False,
    device: Annotated[
        str, Parameter(help="where networks are evaluated and trained: cpu, cuda or mps.")
    ] = "cpu",
) -> None:
    """Measure how fast everything is on this machine, at the paper's network size; takes some minutes."""
    from naisr_model.benchmark.bench import QUICK, Scope, markdown
    from naisr_model.benchmark.bench import bench as run

    scope = QUICK if quick else Scope()
    _measure(
        "measuring",
        partial(run, atlas or shipped_atlas(), scope, device=device),
        partial(markdown, scope=scope),
        json_file,
    )


def _with_held_out(atlas: Path, store: Path | None, limit: int, least: int = 0) -> tuple[Any, Any]:
    """An atlas, and the store of its held-out shapes where one was named."""
    from naisr_model.atlas import Atlas
    from naisr_model.data.store import SampleStore

    require_at_least("--limit", limit, least)
    return Atlas.load(atlas), None if store is None else SampleStore.open(store)


def _measure(
    label: str,
    run: Callable[..., dict[str, Any]],
    markdown: Callable[[dict[str, Any]], str],
    json_file: Path | None,
) -> None:
    """Run a measurement under a bar, print its tables and write its figures.

    Args:
        label: in front of the bar.
        run: gives the record; takes ``progress`` and ``should_stop``.
        markdown: the record as text.
        json_file: where the figures go, if anywhere.
    """
    with bar(label) as progress, stoppable() as stop:
        record = run(progress=progress, should_stop=stop)
    print(markdown(record))
    write_json(json_file, record)
