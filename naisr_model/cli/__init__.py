"""The ``naisr`` command. Nothing is loaded before Ctrl+C is looked after."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from naisr_model.errors import InputError
from naisr_model.terminal import run


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point.

    Args:
        arguments: the words after ``naisr``; left out, those of the command line.

    Returns:
        0 on success, 2 for input that cannot be used, 130 when stopped by the user.
    """
    words = sys.argv[1:] if arguments is None else arguments
    return run("naisr", lambda: _follow(words), is_all=arguments is None)


def _follow(words: Sequence[str]) -> int:
    from cyclopts import CycloptsError

    from naisr_model.cli.commands import app

    try:
        app(words, result_action="return_value", exit_on_error=False, print_error=False)
    except CycloptsError as error:
        raise InputError(str(error)) from error
    return 0
