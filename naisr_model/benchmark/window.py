"""The window: what the viewer measures of itself, in processes of its own."""

from __future__ import annotations

import json
import statistics
import sys
import tempfile
from pathlib import Path
from typing import Any

from naisr_model import checkpoint
from naisr_model.benchmark.figures import Figure, Figures
from naisr_model.benchmark.subject import Scope, Subject, size
from naisr_model.benchmark.timing import told

WINDOW = ("event_to_picture_p95_ms", "release_to_exact_s", "window_visible_s", "first_picture_s")


def figures(scope: Scope) -> tuple[Figure, ...]:
    """What is measured, in the order of the table."""
    return (
        Figure(
            "event_to_picture_p95_ms",
            "ms",
            "95th percentile from a change of a slider to a painted window with its value or a later one, "
            f"all views, at {size(scope)}",
            at_most=90.0,
        ),
        Figure("release_to_exact_s", "s", "from the release of the mouse to all views exact", at_most=1.5),
        Figure("window_visible_s", "s", "from the start of the process to a painted window", at_most=1.5),
        Figure(
            "first_picture_s",
            "s",
            "from the start of the process to all views exact, of an atlas that was open before",
            at_most=4.0,
        ),
        Figure("frames_dropped_share", "", "share of the slider's positions that a newer one overtook"),
    )


def measure(subject: Subject) -> Figures:
    """Medians over several starts of the program."""
    with tempfile.TemporaryDirectory() as folder:
        atlas, file = Path(folder) / "atlas.safetensors", Path(folder) / "figures.json"
        checkpoint.save(atlas, subject.sized.checkpoint)
        device = str(subject.atlas.device)
        runs = [watched(atlas, file, device) for _ in range(subject.scope.viewer_runs)]
    shares = [run["frames_dropped"] / run["events"] for run in runs]
    return {
        **{key: float(statistics.median(run[key] for run in runs)) for key in WINDOW},
        "frames_dropped_share": statistics.median(shares),
    }


def watched(atlas: Path, file: Path, device: str) -> dict[str, Any]:
    """What the viewer writes to ``file`` about itself; Impossible where it cannot run."""
    command = [sys.executable, "-m", "naisr_viewer", str(atlas), "--measure", str(file), "--device", device]
    told(command, "the window")
    return json.loads(file.read_text(encoding="utf-8"))
