"""What is usual among the people of an atlas, on disk: some ten kilobytes instead of a minute."""

from __future__ import annotations

from pathlib import Path

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

OWN, RATIOS, SHARES = "own", "ratios", "local"


def save_norms(norms: Norms, path: Path) -> None:
    """Write them as a ``.safetensors`` file, in one step; its name has to say whose they are."""
    arrays = {f"{OWN}.{name}": values for name, values in norms.own.items()}
    arrays |= {f"{RATIOS}.{name}": spread.ratios for name, spread in norms.spreads.items()}
    arrays[SHARES] = norms.local.shares
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
            LocalSpread(np.asarray(gauge.coarse.points_mm), arrays[SHARES], gauge.coarse),
        )
    except (SafetensorError, OSError, KeyError, ValueError) as error:
        raise InputError(
            f"{path} does not hold what is usual among the people of an atlas ({error})"
        ) from error


def _require_sound(arrays: dict[str, NDArray[np.float64]], gauge: Gauge, people: int) -> None:
    """Make sure that the numbers can be used: whoever does asks no more.

    Raises:
        ValueError: when they cannot.
    """
    lengths = {f"{kind}.{name}": people for kind in (OWN, RATIOS) for name in gauge.measures}
    for name, length in {**lengths, SHARES: len(gauge.coarse.points_mm)}.items():
        array = arrays[name]
        if array.shape != (length,) or not (np.isfinite(array).all() and (array > 0).all()):
            raise ValueError(f"its '{name}' is not {length} numbers above 0")
