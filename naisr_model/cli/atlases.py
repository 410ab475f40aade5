"""Commands that make an atlas and show what is in it: ``train``, ``info`` and ``mesh``."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from naisr_model.cli.console import stoppable, training_bar
from naisr_model.cli.options import AtlasFile, covariate_values, seconds
from naisr_model.errors import InputError
from naisr_model.files import replacing


def train(
    store: Path,
    *,
    out: Path,
    preset: str = "demo",
    config: Path | None = None,
    epochs: int | None = None,
    time_budget: str | None = None,
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
        time_budget: train for about so long, as 90s, 45m or 1.5h.
        seed: of the initial weights and of every draw.
        device: cpu, cuda or mps.
    """
    from naisr_model.config import preset as named
    from naisr_model.config import read_toml
    from naisr_model.data.store import SampleStore
    from naisr_model.learning.training.loop import train as run

    budget = math.inf if time_budget is None else seconds(time_budget)
    chosen = named(preset) if config is None else read_toml(config, named(preset))
    changes: dict[str, Any] = {"epochs": epochs, "seed": seed}
    training = dataclasses.replace(chosen.training, **{k: v for k, v in changes.items() if v is not None})
    with training_bar() as report, stoppable() as stop:
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


def info(atlas: AtlasFile) -> None:
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


def mesh(
    atlas: Path,
    out: Path,
    *,
    set: Annotated[list[str] | None, Parameter(name="--set", negative=())] = None,
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
        set: a covariate's value in real units, as age=120; the others are at the population centre.
        effect: the covariate whose disentangled shape is wanted instead of the full shape.
        template: write the template.
        resolution: cells along a side of the box, a multiple of 8.
        extrapolate: allow values outside the observed range.
        device: where the networks are evaluated: cpu, cuda or mps.
    """
    from naisr_model.atlas import Atlas

    if out.suffix.lower() not in (".stl", ".ply", ".obj", ".glb"):
        raise InputError(f"cannot write '{out.suffix}'; name the file .stl, .ply, .obj or .glb")
    if template and (effect is not None or set):
        raise InputError("the template depends on no covariate; leave out --effect and --set")
    loaded = Atlas.load(atlas, device)
    values = covariate_values(set or [], loaded.covariates)
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
