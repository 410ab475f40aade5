"""Memory: the most that making one surface takes."""

from __future__ import annotations

import sys

from naisr_model.atlas import Atlas
from naisr_model.benchmark.figures import Figure, Figures
from naisr_model.benchmark.paper_size import paper_sized
from naisr_model.benchmark.subject import Scope, Subject, size
from naisr_model.benchmark.timing import told


def figures(scope: Scope) -> tuple[Figure, ...]:
    """What is measured."""
    return (
        Figure(
            f"peak_memory_{scope.memory}_mb",
            "MB",
            f"most memory that a fresh process held resident while it made one mesh at {scope.memory}³, "
            f"the interpreter and libraries included, at {size(scope)}",
            at_most=2000.0 if scope.memory == 512 else None,
        ),
    )


def measure(subject: Subject) -> Figures:
    """Asked of a fresh process."""
    resolution = subject.scope.memory
    device, enlarged = str(subject.atlas.device), subject.scope.enlarged
    call = f"mesh_and_report({str(subject.path)!r}, {resolution}, {device!r}, enlarged={enlarged})"
    command = f"from {__name__} import mesh_and_report; {call}"
    said = told([sys.executable, "-c", command], "the memory")
    return {f"peak_memory_{resolution}_mb": float(said.split()[-1])}


def mesh_and_report(path: str, resolution: int, device: str, *, enlarged: bool) -> None:
    """Make one mesh, at the paper's network size or the atlas's own; print the peak memory in MB."""
    import resource

    atlas = Atlas.load(path, device)
    (paper_sized(atlas) if enlarged else atlas).shape({}, resolution=resolution)
    unit = 1 if sys.platform == "darwin" else 1024
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6)
