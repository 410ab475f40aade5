"""How something is measured: by the clock, or in a process of its own."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Callable, Sequence

import torch

SUBPROCESS_SECONDS = 300.0


class Impossible(Exception):
    """What cannot be measured here, and why, as a sentence."""


def timed(run: Callable[[], object]) -> float:
    """Seconds that ``run`` takes, to the end of what it leaves an accelerator to do."""
    start = time.perf_counter()
    run()
    if torch.accelerator.is_available():
        torch.accelerator.synchronize()
    return time.perf_counter() - start


def told(command: Sequence[str], what: str) -> str:
    """Standard output of a process that measures something.

    Raises:
        Impossible: when it cannot run here.
    """
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=SUBPROCESS_SECONDS, check=True)
    except subprocess.CalledProcessError as error:
        reason = (error.stderr.strip().splitlines() or ["it said nothing"])[-1]
        raise Impossible(f"Not measured: {what}; {reason}.") from error
    except (OSError, subprocess.TimeoutExpired) as error:
        raise Impossible(f"Not measured: {what}; {error}.") from error
    return done.stdout
