"""The ``naisr`` command: argument parsing only; each command calls one function of the library."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from cyclopts import App, CycloptsError

from naisr_model import __version__
from naisr_model.cli import atlases, data, evaluating, patients
from naisr_model.errors import Cancelled, InputError

COMMANDS = (
    *(data.populate, data.prepare),
    *(atlases.train, atlases.mesh),
    *(patients.fit, patients.transfer, patients.evolve),
    *(atlases.info, evaluating.evaluate, evaluating.bench),
)

app = App(
    name="naisr",
    version=__version__,
    help="Shape atlases that explain: prepare data, train, inspect, evaluate and export.",
)
for _command in COMMANDS:
    app.command(_command)


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point.

    Args:
        arguments: the words after ``naisr``; left out, those of the command line.

    Returns:
        0 on success, 2 for input that cannot be used, 130 when stopped by the user.
    """
    try:
        app(
            sys.argv[1:] if arguments is None else arguments,
            result_action="return_value",
            exit_on_error=False,
            print_error=False,
        )
    except (InputError, CycloptsError) as error:
        print(f"naisr: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"naisr: {error.strerror or error}: {error.filename or ''}", file=sys.stderr)
        return 2
    except (Cancelled, KeyboardInterrupt):
        print("naisr: stopped; what was finished is kept", file=sys.stderr)
        return 130
    return 0
