"""What is usual among the people of an atlas, on disk: a megabyte instead of a minute."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load_file
from safetensors.numpy import save as in_memory

from naisr_model.atlas import Atlas
from naisr_model.errors import InputError
from naisr_model.files import replacing
from naisr_model.measures.curves import Gauge, gauge_of
from naisr_model.measures.norms import LocalSpread, Norms, Spread

OWN, RATIOS, OFFSETS = "own", "ratios", "offsets"


def save_norms(norms: Norms, path: Path) -> None:
    """Write them as a ``.safetensors`` file, in one step; its name has to say whose they are."""
    arrays: dict[str, NDArray[Any]] = {f"{OWN}.{name}": values for name, values in norms.own.items()}
    arrays |= {f"{RATIOS}.{name}": spread.ratios for name, spread in norms.spreads.items()}
    arrays[OFFSETS] = norms.local.offsets
    packed = {name: np.ascontiguousarray(array) for name, array in arrays.items()}
    with replacing(path) as temporary:
        temporary.write_bytes(in_memory(packed))


def load_norms(path: Path, atlas: Atlas) -> Norms:
    """Read what :func:`save_norms` wrote of the same atlas.

    Raises:
        InputError: when there is no such file, or it holds something else.
    """
    try:
        arrays = load_file(path)
        gauge = gauge_of(atlas)
        _require_sound(arrays, gauge, len(atlas.checkpoint.latents))
        return Norms(
            atlas,
            gauge,
            {name: arrays[f"{OWN}.{name}"] for name in gauge.measures},
            {name: Spread(arrays[f"{RATIOS}.{name}"]) for name in gauge.measures},
            LocalSpread(np.asarray(gauge.coarse.points_mm), arrays[OFFSETS], gauge.coarse),
        )
    except (SafetensorError, OSError, KeyError, ValueError) as error:
        raise InputError(
            f"{path} does not hold what is usual among the people of an atlas ({error})"
        ) from error


def _require_sound(arrays: dict[str, NDArray[Any]], gauge: Gauge, people: int) -> None:
    """Make sure that the numbers can be used: whoever does asks no more.

    Raises:
        ValueError: when they cannot.
    """
    for name in (f"{kind}.{name}" for kind in (OWN, RATIOS) for name in gauge.measures):
        array = arrays[name]
        if array.shape != (people,) or not (np.isfinite(array).all() and (array > 0).all()):
            raise ValueError(f"its '{name}' is not {people} numbers above 0")
    offsets, points = arrays[OFFSETS], len(gauge.coarse.points_mm)
    if offsets.shape != (people, points) or offsets.dtype != np.float16 or not np.isfinite(offsets).all():
        raise ValueError(f"its '{OFFSETS}' is not {people} times {points} numbers")
