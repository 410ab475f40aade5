"""The ``naisr`` command: argument parsing only; each command calls one function of the library."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from cyclopts import App, CycloptsError, Parameter

from naisr_model import __version__
from naisr_model.cli import atlases, benchmarking, data, patients
from naisr_model.cli.options import converted
from naisr_model.errors import Cancelled, InputError

COMMANDS = (
    *(data.populate, data.prepare),
    *(patients.fit, patients.transfer, patients.evolve),
    *(atlases.info, atlases.mesh, benchmarking.bench),
)

TRAINING = """Train an atlas; stop it whenever you like, the same command goes on.

OUT can be opened from the first minute on; OUT.training/ beside it keeps the state to resume from, a
TensorBoard log and the template at chosen epochs.
"""

app = App(
    name="naisr",
    version=__version__,
    help="Shape atlases that explain: prepare data, train, inspect, evaluate and export.",
    default_parameter=Parameter(negative=(), converter=converted),
)
for _command in COMMANDS:
    app.command(_command)
# What these offer comes from the models and the studies, which load torch; so only when they are asked for.
app.command(
    "naisr_model.cli.training:train",
    name="train",
    help=TRAINING,
)
app.command("naisr_model.cli.evaluating:evaluate", name="evaluate", help="Measure how good an atlas is.")


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point.

    Args:
        arguments: the words after ``naisr``; left out, those of the command line.

    Returns:
        0 on success, 2 for input that cannot be used, 130 when stopped by the user.
    """
    try:
        with _interrupts():
            app(
                sys.argv[1:] if arguments is None else arguments,
                result_action="return_value",
                exit_on_error=False,
                print_error=False,
            )
    except (InputError, CycloptsError) as error:
        for note in getattr(error, "__notes__", ()):
            print(note, file=sys.stderr)
        print(f"naisr: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"naisr: {error.strerror or error}: {error.filename or ''}", file=sys.stderr)
        return 2
    except MemoryError:
        print(
            "naisr: this machine's memory does not suffice; ask for less, as a lower resolution",
            file=sys.stderr,
        )
        return 2
    except (Cancelled, KeyboardInterrupt):
        print("naisr: stopped; what was finished is kept", file=sys.stderr)
        return 130
    return 0


@contextmanager
def _interrupts() -> Iterator[None]:
    """Ctrl+C stays what it is: a library that is loaded just then may make a mistake of its own of it.

    Raises:
        KeyboardInterrupt: in the place of whatever came of one.
    """
    came: list[int] = []

    def interrupt(number: int, _frame: object) -> None:
        came.append(number)
        raise KeyboardInterrupt

    previous = signal.signal(signal.SIGINT, interrupt)
    try:
        yield
    except Exception as error:
        if came:
            raise KeyboardInterrupt from error
        raise
    finally:
        signal.signal(signal.SIGINT, previous)
