"""The fast fit against the paper's procedure: the same shapes, the same machine, the same run."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from naisr_model.atlas import Atlas
from naisr_model.config import FitConfig
from naisr_model.covariates import normalised_vector
from naisr_model.data.samples import ShapeSamples, sample_shape
from naisr_model.errors import InputError
from naisr_model.evaluation.held_out import HeldOut, held_out, held_out_rows, opened, require_shapes
from naisr_model.evaluation.reports import markdown_table
from naisr_model.learning.fitting.paper import fit_latents
from naisr_model.learning.training.objective import Batch
from naisr_model.progress import SILENT, Progress
from naisr_model.work.journal import Record

SAMPLES, CHECK_POINTS, CHECK_SEED = 20_000, 4000, 1
MOST_STEPS = 100_000


@dataclass(frozen=True)
class HeldOutRow:
    """A held-out shape, by its row in the population."""

    row: int

    @property
    def key(self) -> str:
        """The row."""
        return f"row {self.row}"


@dataclass(frozen=True)
class Fitting:
    """Compare the fit with the paper's procedure on held-out shapes; the latter takes a minute a shape.

    Attributes:
        atlas: the .safetensors file.
        store: where its held-out shapes are; not needed for the synthetic populations, which are made
            again from their seed.
        limit: at most so many held-out shapes.
        steps: Adam steps of the paper's procedure, which takes 800 for the airway and 200 elsewhere.
    """

    atlas: Path
    _: KW_ONLY
    store: Path | None = None
    limit: int = 50
    steps: int = FitConfig.steps

    def cases(self) -> list[HeldOutRow]:
        """The first held-out shapes.

        Raises:
            InputError: when there are none to be had, or ``limit`` or ``steps`` is out of range.
        """
        if self.limit < 1:
            raise InputError(f"--limit is {self.limit}; give 1 or more")
        if not 1 <= self.steps <= MOST_STEPS:
            raise InputError(f"--steps is {self.steps}; give 1 or more, up to {MOST_STEPS}")
        atlas = opened(self.atlas)
        require_shapes(atlas, self.store, self.limit)
        return [HeldOutRow(row) for row in held_out_rows(atlas, self.limit)]

    def measure(self, case: HeldOutRow, progress: Progress = SILENT) -> Record:
        """One shape fitted both ways, covariates known: residual on points that neither has seen, seconds.

        Raises:
            Cancelled: when nobody waits any more.
        """
        atlas = opened(self.atlas)
        shape = held_out(atlas, self.store, case.row)
        config = replace(FitConfig(), steps=self.steps)
        return {
            "fast": _measured(atlas, shape, *fast(atlas, shape, progress)),
            "reference": _measured(atlas, shape, *reference(atlas, shape, config, progress)),
        }

    def summarise(self, records: Sequence[Record]) -> Record:
        """The report.

        Returns:
            ``n``; ``residual_mm`` and ``seconds``, the mean of each way; ``no_worse``, the share of shapes
            on which the fast fit's residual is equal or lower; ``times_faster``, by the total time.
        """
        columns = {
            name: {way: np.array([record[way][name] for record in records]) for way in ("fast", "reference")}
            for name in ("residual_mm", "seconds")
        }
        residual, seconds = columns["residual_mm"], columns["seconds"]
        return {
            "n": len(records),
            **{
                name: {way: float(values.mean()) for way, values in ways.items()}
                for name, ways in columns.items()
            },
            "no_worse": float((residual["fast"] <= residual["reference"]).mean()),
            "times_faster": float(seconds["reference"].sum() / seconds["fast"].sum()),
        }

    def markdown(self, report: Mapping[str, Any]) -> str:
        """The report as a table."""
        labels = {
            "fast": "this program, intervals included",
            "reference": f"{self.steps} Adam steps, as in the paper",
        }
        rows = [
            [label, f"{report['residual_mm'][way]:.3f}", f"{report['seconds'][way]:.2f}"]
            for way, label in labels.items()
        ]
        table = markdown_table(
            ["", f"held-out residual, {opened(self.atlas).frame.unit}", "seconds a shape"], rows
        )
        told = f"Equal or lower residual on {100 * report['no_worse']:.0f} % of the shapes"
        title = f"**{report['n']} held-out shapes, covariates known**"
        return f"{title}\n\n{table}\n\n{told}, {report['times_faster']:.0f} times faster."


def fast(atlas: Atlas, shape: HeldOut, progress: Progress = SILENT) -> tuple[NDArray[Any], float]:
    """The code ``[L]`` of a shape as this program fits it, and the seconds until its intervals are known."""
    fit = atlas.fit(shape.mesh_mm, shape.values, extrapolate=True, progress=progress)
    return fit.latent, fit.seconds


def reference(
    atlas: Atlas, shape: HeldOut, config: FitConfig, progress: Progress = SILENT
) -> tuple[NDArray[Any], float]:
    """The same as the paper fits it."""
    samples = sample_shape(shape.mesh_mm, atlas.frame, SAMPLES, SAMPLES, SAMPLES, config.seed)
    known = torch.as_tensor(normalised_vector(atlas.covariates, shape.values), dtype=torch.float32)[None]
    model, weights = atlas.checkpoint.model(), atlas.checkpoint.preset.training.loss
    started = time.perf_counter()
    latents = fit_latents(
        model, lambda rng: _draw(samples, config, rng), known, config, weights, progress=progress
    )
    return latents[0].numpy(), time.perf_counter() - started


def _draw(samples: ShapeSamples, config: FitConfig, rng: np.random.Generator) -> Batch:
    half = config.space_points // 2
    on, near, far = (rng.integers(0, SAMPLES, count) for count in (config.surface_points, half, half))
    surface, space = samples.surface[on], np.concatenate([samples.near[near], samples.uniform[far]])
    dim = space.shape[-1] - 1
    parts = (surface[:, :dim], surface[:, dim:], space[:, :dim], space[:, dim])
    return Batch.from_arrays(*(part[None] for part in parts))


def _measured(atlas: Atlas, shape: HeldOut, latent: NDArray[Any], seconds: float) -> Record:
    """Mean distance, to first order, of the shape's own points from the fitted surface."""
    points = sample_shape(shape.mesh_mm, atlas.frame, CHECK_POINTS, 1, 1, CHECK_SEED).surface
    points_mm = atlas.frame.to_mm(points[:, : atlas.frame.dim])
    found_mm = atlas.sdf(points_mm, shape.values, latent, extrapolate=True)
    return {"residual_mm": float(np.abs(found_mm).mean()), "seconds": seconds}
