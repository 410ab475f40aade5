"""Commands that show what is in an atlas: ``info`` and ``mesh``."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from naisr_model.cli.options import AtlasFile, FileToWrite
from naisr_model.errors import InputError
from naisr_model.files import replacing

if TYPE_CHECKING:
    from naisr_model.covariates import Covariate, Population  # loads numpy, which '--help' does not need


TRAINED: dict[str, Callable[[float], str]] = {
    "iterations": "{:,} iterations".format,
    "seconds": lambda seconds: f"{seconds / 60:.1f} minutes",
    "folded_share": lambda share: f"folded points near the surface {100 * share:.2f} %",
}
"""How the figures of a training read."""


def info(atlas: AtlasFile) -> None:
    """Show what an atlas is made of."""
    from naisr_model.checkpoint import load

    checkpoint = load(atlas)
    model = checkpoint.model()
    weights = sum(tensor.numel() for tensor in checkpoint.weights.values())
    print(f"{checkpoint.name}: trained on {_counted(checkpoint.population, held_out=False)}; ", end="")
    print(f"{_counted(checkpoint.population, held_out=True)} held out")
    for covariate in model.relevant(checkpoint.population).covariates:
        print(f"  {_extent(covariate)}")
    if not model.capabilities.evolvable:
        print("  its shapes depend on no covariates")
    print(f"model: {model.title}")
    for can in model.capabilities.told:
        print(f"  {can}")
    print(f"networks: {weights:,} weights, latent code of {checkpoint.preset.network.latent}")
    width = checkpoint.frame.length(2 * checkpoint.frame.scale_mm, 0)
    where = "in the plane, " if checkpoint.frame.dim == 2 else ""
    print(f"box: {width} wide, {where}alignment by {checkpoint.alignment.method}")
    if checkpoint.source:
        print(f"source: {', '.join(f'{key} {value}' for key, value in checkpoint.source.items())}")
    measured = {key: value for key, value in checkpoint.training.items() if math.isfinite(value)}
    told = [say(measured[key]) for key, say in TRAINED.items() if key in measured]
    print(f"training: {', '.join(told)}")


def _counted(population: Population, *, held_out: bool) -> str:
    """``277 shapes of 204 subjects``."""
    chosen = population.held_out == held_out
    subjects = {subject for subject, is_one in zip(population.subjects, chosen, strict=True) if is_one}
    return f"{int(chosen.sum())} shapes of {len(subjects)} subjects"


def _extent(covariate: Covariate) -> str:
    """What was observed of a covariate; a binary one has nothing between its levels."""
    if covariate.kind == "binary":
        return f"{covariate.name}: {' or '.join(covariate.levels)}"
    low, high = (covariate.format(value) for value in covariate.range)
    return f"{covariate.name}: {low} to {high}, centre {covariate.format(covariate.centre)}"


def mesh(
    atlas: Path,
    out: FileToWrite,
    *,
    set: Annotated[list[str] | None, Parameter(name="--set")] = None,
    effect: str | None = None,
    template: bool = False,
    resolution: int = 128,
    extrapolate: bool = False,
    device: str = "cpu",
) -> None:
    """Write one surface of an atlas (STL, PLY, OBJ, VTP or GLB by the file's name) or one curve (SVG, CSV).

    Coordinates are millimetres with z up; in GLB metres with y up, as that format says. Those of a curve
    are in the unit of its atlas, with y up.

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
    from naisr_model.covariates import read_values, require_known
    from naisr_model.exports import require_format
    from naisr_model.shapes.written import shape_bytes

    require_format(out)
    if template and (effect is not None or set):
        raise InputError("the template depends on no covariate; leave out --effect and --set")
    loaded = Atlas.load(atlas, device)
    ending = require_format(out, loaded.frame.dim)
    if set and not loaded.covariates:
        raise InputError(f"shapes of {loaded.model_title} depend on no covariates; leave out --set")
    values = read_values("--set", set or [], loaded.covariates)
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
        nearer = "train the atlas for longer" if not values else "choose values nearer to the data"
        raise InputError(f"the atlas has no surface there; {nearer}")
    with replacing(out) as temporary:
        temporary.write_bytes(shape_bytes(surface, ending, loaded.frame.unit))
    parts = {2: "segments", 3: "faces"}[loaded.frame.dim]
    print(f"{out}: {len(surface.faces)} {parts}, {loaded.extent.told(loaded.extent.of(surface), 2)}")
