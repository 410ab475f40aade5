"""The command line: ``naisr-viewer [ATLAS]``. Nothing heavy is imported before the arguments are read."""

from __future__ import annotations

import re
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from naisr_model.terminal import loading, run

with loading("naisr-viewer"):
    import cyclopts
    from cyclopts import Parameter

    from naisr_model.errors import InputError
    from naisr_model.files import checked_place, require_file
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
    """Run the program; returns the exit code: 0, or 2 or 130 (Ctrl+C) after one sentence on stderr."""
    tokens = list(sys.argv[1:] if arguments is None else arguments)
    return run("naisr-viewer", lambda: _follow(tokens), is_all=arguments is None)


def _follow(tokens: list[str]) -> int:
    try:
        return cli(tokens, exit_on_error=False, print_error=False, result_action="return_value") or 0
    except cyclopts.CycloptsError as error:
        raise InputError(str(error)) from error


@cli.default
def view(
    atlas: Path | None = None,
    /,
    *,
    settings: Annotated[list[str] | None, Parameter("--set", negative=())] = None,
    scan: Path | None = None,
    label: str | None = None,
    session: Path | None = None,
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
    label
        Which label of a volume, its number or its name; with --scan.
    session
        What was on screen when File > Save session… wrote this file.
    screenshot
        Write a picture of the window to this PNG file and end; needs no display.
    demo
        Drag every slider from end to end, write pictures and meshes into this folder and end;
        needs no display.
    measure
        Time the start and a drag of a slider, write the figures to this JSON file and end;
        needs no display.
    size
        Size of the window in pixels, WIDTHxHEIGHT; left out, that of the last time; of pictures that of
        the session or 1280x800.
    device
        Where exact surfaces are computed: cpu, cuda or mps.
    """
    if session is not None:
        return _go_on(session, size, screenshot, demo, device, [atlas, settings, scan, label, measure])
    path = (atlas or shipped_atlas()).absolute()
    pixels = USUAL_PIXELS if size is None else parse_size(size)
    require_file(path, "an atlas (.safetensors)")
    if label is not None and scan is None:
        raise InputError(f"--label {label} is of a scan; give --scan FILE too")
    _require_places(screenshot, demo, measure)
    engine = start.make_engine(device)
    if measure is not None:
        if settings or scan or label is not None or screenshot or demo:
            raise InputError("--measure times the window as it starts; leave out the other options")
        return start.measured(engine, path, pixels, measure, LOADED)
    card = engine.open(path) if settings or screenshot or demo else None
    first = start.First(path, card, parse_settings(card, settings or []) if card else {}, scan, label)
    if screenshot or demo:
        return start.unattended(engine, first, pixels, screenshot, demo)
    return start.attended(engine, first, None if size is None else pixels)


def _go_on(
    session: Path,
    size: str | None,
    screenshot: Path | None,
    demo: Path | None,
    device: str,
    others: Sequence[object],
) -> int:
    """The window as a session has it."""
    if any(others):
        raise InputError(
            "--session says what is shown; leave out atlas, --set, --scan, --label and --measure"
        )
    from naisr_viewer.files.sessions import read_session

    saved = read_session(session)
    _require_places(screenshot, demo)
    pixels = None if size is None else parse_size(size)
    first = start.First(saved.atlas.path, session=session.absolute())
    engine = start.make_engine(device)
    if screenshot or demo:
        return start.unattended(engine, first, pixels or saved.window_px, screenshot, demo)
    return start.attended(engine, first, pixels)


def _require_places(picture: Path | None, demo: Path | None, figures: Path | None = None) -> None:
    for file in filter(None, (picture, figures)):
        checked_place(file)
    if demo is not None and demo.exists() and not demo.is_dir():
        raise InputError(f"--demo writes into a folder, and {demo} is none; give another name")


def parse_settings(card: AtlasCard, settings: Sequence[str]) -> dict[str, float]:
    """``["age=120", "sex=M"]`` as real values by name.

    Raises:
        InputError: for what is no setting, and for any where shapes depend on no covariates.
    """
    if settings and not card.covariates:
        raise InputError(f"leave out --set: the shapes of {card.path.name} depend on no covariates")
    return card.read_values("--set", settings)


def parse_size(text: str) -> tuple[int, int]:
    """``1280x800`` as two numbers.

    Raises:
        InputError: when it is anything else.
    """
    parts = re.fullmatch(r"([0-9]{3,5})x([0-9]{3,5})", text.lower())
    width, height = map(int, parts.groups()) if parts else (0, 0)
    if not (640 <= width <= 7680 and 480 <= height <= 4320):
        raise InputError(f"--size {text} is not understood; write WIDTHxHEIGHT, from 640x480 to 7680x4320")
    return width, height
