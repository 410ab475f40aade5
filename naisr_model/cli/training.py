"""``naisr train``: making an atlas. Its help names the presets, which come from the shape models."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from naisr_model.cli.console import training_bar
from naisr_model.cli.options import FileToWrite, seconds
from naisr_model.config import Preset, read_toml
from naisr_model.data.store import SampleStore
from naisr_model.learning.training.loop import train as run_training
from naisr_model.models.factory import model_class, presets
from naisr_model.models.factory import preset as preset_called


def _told(known: Mapping[str, Preset]) -> str:
    """The presets of each model."""
    models = dict.fromkeys(preset.model for preset in known.values())
    names = {model: [name for name, preset in known.items() if preset.model == model] for model in models}
    listed = [f"{model_class(model).title}: {', '.join(own)}" for model, own in names.items()]
    return f"the settings. {'; '.join(listed)}; a demo is for two CPU cores."


def train(
    store: Path,
    *,
    out: FileToWrite,
    preset: Annotated[str, Parameter(help=_told(presets()))] = "demo",
    config: Path | None = None,
    epochs: int | None = None,
    time_budget: str | None = None,
    seed: int | None = None,
    device: str = "cpu",
) -> None:
    """Train an atlas, see :data:`naisr_model.cli.commands.TRAINING`.

    Args:
        store: made by 'naisr prepare'.
        out: the .safetensors file to write.
        preset: the settings, by name.
        config: a TOML file with settings on top of the preset.
        epochs: passes over the training shapes.
        time_budget: train for about so long, as 90s, 45m or 1.5h.
        seed: of the initial weights and of every draw.
        device: cpu, cuda or mps.
    """
    budget = math.inf if time_budget is None else seconds(time_budget)
    chosen = preset_called(preset) if config is None else read_toml(config, preset_called(preset))
    changes: dict[str, Any] = {"epochs": epochs, "seed": seed}
    training = dataclasses.replace(chosen.training, **{k: v for k, v in changes.items() if v is not None})
    with training_bar() as (progress, report):
        checkpoint = run_training(
            SampleStore.open(store),
            dataclasses.replace(chosen, training=training),
            out,
            time_budget_s=budget,
            report=report,
            progress=progress,
            device=device,
        )
    print(f"{out} after {checkpoint.training['iterations']} iterations")
    if "folded_share" in checkpoint.training:
        print(f"folded points near the surface: {100 * checkpoint.training['folded_share']:.2f} %")
