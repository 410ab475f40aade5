"""Commands that show what is in an atlas: ``info`` and ``mesh``."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from naisr_model.cli.options import AtlasFile, covariate_values
from naisr_model.errors import InputError
from naisr_model.files import replacing


def info(atlas: AtlasFile) -> None:
    """Show what an atlas is made of."""
    from naisr_model.checkpoint import load

    checkpoint = load(atlas)
    population = checkpoint.population
    held_out = int(population.held_out.sum())
    weights = sum(tensor.numel() for tensor in checkpoint.weights.values())
    model = checkpoint.model()
    abilities = [
        name.replace("_", " ") for name, can in dataclasses.asdict(model.capabilities).items() if can
    ]
    print(
        f"{checkpoint.name}: {len(population)} shapes of {len(set(population.subjects))} subjects, ", end=""
    )
    print(f"{held_out} shapes held out")
    for covariate in population.covariates:
        low, high = (covariate.format(value) for value in covariate.range)
        print(f"  {covariate.name}: {low} to {high}, centre {covariate.format(covariate.centre)}")
    print(f"model: {model.title}: {', '.join(abilities)}")
    print(f"networks: {weights:,} weights, latent code of {checkpoint.preset.network.latent}")
    print(f"box: {2 * checkpoint.frame.scale_mm:.0f} mm wide, alignment by {checkpoint.alignment.method}")
    for key, value in {**checkpoint.source, **checkpoint.training}.items():
        print(f"{key}: {value}")


def mesh(
    atlas: Path,
    out: Path,
    *,
    set: Annotated[list[str] | None, Parameter(name="--set")] = None,
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
        effect: the covariate whose effect is wanted instead of the full shape.
        template: write the template.
        resolution: cells along a side of the box, a multiple of 8.
        extrapolate: allow values outside the observed range.
        device: where the networks are evaluated: cpu, cuda or mps.
    """
    from naisr_model.atlas import Atlas
    from naisr_model.covariates import require_known

    if out.suffix.lower() not in (".stl", ".ply", ".obj", ".glb"):
        raise InputError(f"cannot write '{out.suffix}'; name the file .stl, .ply, .obj or .glb")
    if template and (effect is not None or set):
        raise InputError("the template depends on no covariate; leave out --effect and --set")
    loaded = Atlas.load(atlas, device)
    if set and not loaded.covariates:
        raise InputError(f"shapes of {loaded.model_title} depend on no covariates; leave out --set")
    values = covariate_values(set or [], loaded.covariates)
    if template:
        if not loaded.capabilities.has_template:
            raise InputError(f"{loaded.model_title} has no template; leave out --template")
        surface = loaded.template(resolution)
    elif effect is not None:
        if not loaded.capabilities.disentangleable:
            raise InputError(f"{loaded.model_title} does not tell covariates apart; leave out --effect")
        require_known([effect], loaded.covariates)
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
