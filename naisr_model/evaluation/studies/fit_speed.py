"""The fast fit against the paper's procedure: the same shapes, the same machine, the same run."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from naisr_model.atlas import Atlas
from naisr_model.config import FitConfig
from naisr_model.covariates import normalised_vector
from naisr_model.data.samples import ShapeSamples, sample_shape
from naisr_model.evaluation.studies.reconstruction import HeldOut
from naisr_model.learning.fitting.prior import prior_of
from naisr_model.learning.fitting.search import fit_latents, fit_shape
from naisr_model.learning.fitting.target import target_of
from naisr_model.learning.training.objective import Batch
from naisr_model.surface.fields import distances

Progress = Callable[[float], None]
StopCheck = Callable[[], bool]

SAMPLES, CHECK_POINTS, CHECK_SEED = 20_000, 4000, 1


def compare_fits(
    atlas: Atlas,
    shapes: Sequence[HeldOut],
    config: FitConfig,
    *,
    progress: Progress | None = None,
    should_stop: StopCheck | None = None,
) -> dict[str, Any]:
    """Fit every shape both ways, covariates known, and measure both on points that neither has seen.

    Args:
        atlas: whose networks are fitted.
        shapes: held-out shapes.
        config: of the paper's procedure.
        progress: told the finished share.
        should_stop: polled between shapes and steps.

    Returns:
        ``n``; ``residual_mm`` and ``seconds``, the mean of each way; ``no_worse``, the share of shapes
        on which the fast fit's residual is equal or lower; ``times_faster``, by the total time.

    Raises:
        Cancelled: when ``should_stop()`` turned true.
    """
    rows = []
    for done, shape in enumerate(shapes, start=1):
        rows.append([*_fast(atlas, shape, should_stop), *_reference(atlas, shape, config, should_stop)])
        if progress is not None:
            progress(done / len(shapes))
    residual, seconds, reference_residual, reference_seconds = np.array(rows).T
    return {
        "n": len(rows),
        "residual_mm": {"fast": float(residual.mean()), "reference": float(reference_residual.mean())},
        "seconds": {"fast": float(seconds.mean()), "reference": float(reference_seconds.mean())},
        "no_worse": float((residual <= reference_residual).mean()),
        "times_faster": float(reference_seconds.sum() / seconds.sum()),
    }


def comparison_markdown(report: Mapping[str, Any], config: FitConfig) -> str:
    """The report of :func:`compare_fits` as a table."""
    labels = {"fast": "this program", "reference": f"{config.steps} Adam steps, as in the paper"}
    lines = [
        f"**{report['n']} held-out shapes, covariates known**",
        "",
        "|  | held-out residual, mm | seconds a shape |",
        "| --- | ---: | ---: |",
    ]
    for key, label in labels.items():
        lines.append(f"| {label} | {report['residual_mm'][key]:.3f} | {report['seconds'][key]:.2f} |")
    return "\n".join(
        [
            *lines,
            "",
            f"Equal or lower residual on {report['no_worse']:.0%} of the shapes, "
            f"{report['times_faster']:.0f} times faster.",
        ]
    )


def _fast(atlas: Atlas, shape: HeldOut, should_stop: StopCheck | None) -> tuple[float, float]:
    network = atlas.checkpoint.network().requires_grad_(False)
    prior = prior_of(atlas.population, atlas.checkpoint.latents)
    known = normalised_vector(atlas.covariates, shape.values)
    target = target_of(shape.mesh_mm, atlas.frame)
    started = time.perf_counter()
    latent = fit_shape(network, target, prior, known, should_stop=should_stop)[0].latent
    seconds = time.perf_counter() - started
    return _residual_mm(atlas, shape, latent), seconds


def _reference(
    atlas: Atlas, shape: HeldOut, config: FitConfig, should_stop: StopCheck | None
) -> tuple[float, float]:
    samples = sample_shape(shape.mesh_mm, atlas.frame, SAMPLES, SAMPLES, SAMPLES, config.seed)
    known = torch.as_tensor(normalised_vector(atlas.covariates, shape.values), dtype=torch.float32)[None]
    network, weights = atlas.checkpoint.network(), atlas.checkpoint.preset.training.loss
    started = time.perf_counter()
    latent = fit_latents(
        network, lambda rng: _draw(samples, config, rng), known, config, weights, should_stop=should_stop
    )
    seconds = time.perf_counter() - started
    return _residual_mm(atlas, shape, latent[0].numpy()), seconds


def _draw(samples: ShapeSamples, config: FitConfig, rng: np.random.Generator) -> Batch:
    half = config.space_points // 2
    on, near, far = (rng.integers(0, SAMPLES, count) for count in (config.surface_points, half, half))
    surface, space = samples.surface[on], np.concatenate([samples.near[near], samples.uniform[far]])
    dim = space.shape[-1] - 1
    parts = (surface[:, :dim], surface[:, dim:], space[:, :dim], space[:, dim])
    return Batch.from_arrays(*(part[None] for part in parts))


def _residual_mm(atlas: Atlas, shape: HeldOut, latent: NDArray[Any]) -> float:
    points = sample_shape(shape.mesh_mm, atlas.frame, CHECK_POINTS, 1, 1, CHECK_SEED).surface
    vector = torch.as_tensor(normalised_vector(atlas.covariates, shape.values), dtype=torch.float32)
    code = torch.as_tensor(latent, dtype=torch.float32)
    network = atlas.checkpoint.network()
    found = distances(network, points[:, : atlas.frame.dim], vector, code)
    return float(np.abs(found).mean()) * atlas.frame.scale_mm
