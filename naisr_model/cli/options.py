"""Options that several commands share, and how the text after an option is read."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from naisr_model.errors import InputError
from naisr_model.files import checked_place

if TYPE_CHECKING:
    from naisr_model.covariates import Covariate  # loads numpy, which '--help' does not need

AtlasFile = Annotated[Path, Parameter(help="the .safetensors file.")]


def _require_figures(_type: object, path: Path | None) -> None:
    """Before the work: what is no place for figures, or holds something else, is refused."""
    if path is not None and checked_place(path).exists():
        try:
            json.loads(path.read_bytes() or b"{}")
        except (OSError, ValueError) as error:
            raise InputError(f"{path} is there and holds no figures; give another file") from error


JsonFile = Annotated[
    Path | None,
    Parameter(name="--json", help="also write the figures to this file.", validator=_require_figures),
]


def pairs(option: str, text: str) -> dict[str, str]:
    """``age=84,sex=M`` as names and texts.

    Raises:
        InputError: when a part has no ``=``.
    """
    parts = [part.partition("=") for part in text.split(",") if part.strip()]
    if wrong := [name for name, equals, _ in parts if not equals]:
        raise InputError(f"'{wrong[0]}' after {option} is not understood; write NAME=VALUE,NAME=VALUE")
    return {name.strip(): value for name, _, value in parts}


def covariate_values(settings: Iterable[str], covariates: Iterable[Covariate]) -> dict[str, float]:
    """What ``--set age=120 --set sex=M`` says, in the units of the covariates.

    Raises:
        InputError: for another form, a name that is not among ``covariates`` or a value it cannot take.
    """
    known = {covariate.name: covariate for covariate in covariates}
    values = {}
    for setting in settings:
        name, equals, text = setting.partition("=")
        if not equals or name not in known:
            raise InputError(
                f"'--set {setting}' is not understood; write NAME=VALUE with one of {', '.join(known)}"
            )
        values[name] = known[name].parse(text)
    return values


def seconds(text: str) -> float:
    """``90s``, ``45m`` or ``1.5h`` in seconds.

    Raises:
        InputError: for anything else.
    """
    factor = {"s": 1.0, "m": 60.0, "h": 3600.0}.get(text[-1:], 0.0)
    try:
        duration = factor * float(text[:-1])
    except ValueError:
        duration = 0.0
    if not 0 < duration < math.inf:
        raise InputError(f"the time budget is '{text}'; write it as 90s, 45m or 1.5h")
    return duration
