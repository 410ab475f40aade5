"""The command line: ``naisr-viewer [ATLAS]``. Nothing heavy is imported before the arguments are read."""

from __future__ import annotations

import re
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import cyclopts
from cyclopts import Parameter

from naisr_model.errors import InputError
from naisr_model.shipped import shipped_atlas
from naisr_viewer import __version__
from naisr_viewer.program import start

if TYPE_CHECKING:
    from naisr_viewer.state.atlas_card import AtlasCard

USUAL_PIXELS = (1280, 800)

LOADED = time.monotonic()
"""When the program was loaded, where the system does not tell when it was started."""

cli = cyclopts.App(
    name="naisr-viewer",
    help="Explore how anatomy changes with age, weight, sex and other covariates.",
    version=__version__,
    help_on_error=False,
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns the exit code: 0, or 2 after one sentence on stderr."""
    try:
        tokens = list(sys.argv[1:] if arguments is None else arguments)
        return cli(tokens, exit_on_error=False, print_error=False, result_action="return_value") or 0
    except (InputError, cyclopts.CycloptsError) as error:
        print(f"naisr-viewer: {error}", file=sys.stderr)
        return 2


@cli.default
def view(
    atlas: Path | None = None,
    /,
    *,
    settings: Annotated[list[str] | None, Parameter("--set", negative=())] = None,
    scan: Path | None = None,
    screenshot: Path | None = None,
    demo: Path | None = None,
    measure: Path | None = None,
    size: str | None = None,
    device: str = "cpu",
) -> int:
    """Open the window on an atlas.

    Parameters
    ----------
    atlas
        A trained atlas (.safetensors); the airway atlas that comes with the program when left out.
    settings
        Where a covariate starts, as NAME=VALUE in real units: --set age=120 --set sex=M.
    scan
        A patient's file to open at once: a mesh, a label volume or a cloud of points.
    screenshot
        Write a picture of the window to this PNG file and end; needs no display.
    demo
        Drag every slider from end to end, write pictures and meshes into this folder and end;
        needs no display.
    measure
        Time the start and a drag of a slider, write the figures to this JSON file and end;
        needs no display.
    size
        Size of the window in pixels, WIDTHxHEIGHT; left out, that of the last time, and 1280x800 of
        pictures and measurements.
    device
        Where exact surfaces are computed: cpu, cuda or mps.
    """
    path = (atlas or shipped_atlas()).absolute()
    pixels = USUAL_PIXELS if size is None else parse_size(size)
    if not path.is_file():
        raise InputError(f"there is no file {path}; give the path of an atlas (.safetensors)")
    engine = start.make_engine(device)
    if measure is not None:
        if settings or scan or screenshot or demo:
            raise InputError("--measure times the window as it starts; leave out the other options")
        return start.measured(engine, path, pixels, measure, LOADED)
    card = engine.open(path) if settings or screenshot or demo else None
    first = start.First(path, card, parse_settings(card, settings or []) if card else {}, scan)
    if screenshot or demo:
        return start.unattended(engine, first, pixels, screenshot, demo)
    return start.attended(engine, first, None if size is None else pixels)


def parse_settings(card: AtlasCard, settings: Sequence[str]) -> dict[str, float]:
    """``["age=120", "sex=M"]`` as real values by name.

    Raises:
        InputError: for an unknown covariate, no number, or a value outside the observed range.
    """
    known = {covariate.name: covariate for covariate in card.covariates}
    if settings and not known:
        raise InputError(f"leave out --set: the shapes of {card.path.name} depend on no covariates")
    values = {}
    for setting in settings:
        name, equals, text = setting.partition("=")
        if not equals or name.strip() not in known:
            raise InputError(
                f"--set {setting} is not understood; write NAME=VALUE, NAME one of {', '.join(known)}"
            )
        covariate = known[name.strip()]
        value = covariate.parse(text)
        if not covariate.contains(value):
            low, high = covariate.range
            seen = f"{low:g} to {high:g} {covariate.unit}".strip()
            raise InputError(f"--set {setting} is out of range; the atlas was made from {seen}")
        values[covariate.name] = value
    return values


def parse_size(text: str) -> tuple[int, int]:
    """``1280x800`` as two numbers.

    Raises:
        InputError: when it is anything else.
    """
    parts = re.fullmatch(r"([0-9]{3,5})x([0-9]{3,5})", text.lower())
    width, height = map(int, parts.groups()) if parts else (0, 0)
    if width < 640 or height < 480:
        raise InputError(f"--size {text} is not understood; write WIDTHxHEIGHT, at least 640x480")
    return width, height
