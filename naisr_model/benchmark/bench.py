"""How fast the program is on this machine, measured on an atlas and on networks of the paper's size.

A measurement is one file here and one line in :data:`MEASUREMENTS`: it says which figures it gives, each with
a key, a unit, a definition and a target, and measures them. Each stands for itself, so that one that cannot
be made here (no display, say) leaves a remark instead of its figures.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

import torch

from naisr_model.atlas import Atlas
from naisr_model.benchmark import dragging, memory, surfaces, training, window
from naisr_model.benchmark.figures import Figure, Figures
from naisr_model.benchmark.machine import machine, versions
from naisr_model.benchmark.subject import Scope, Subject
from naisr_model.benchmark.timing import Impossible
from naisr_model.errors import InputError
from naisr_model.evaluation.reports import markdown_table
from naisr_model.models.naisr.network import Naisr
from naisr_model.progress import SILENT, Progress


class Measurement(Protocol):
    """What the module of a measurement offers."""

    def figures(self, scope: Scope) -> tuple[Figure, ...]:
        """What it may give, in the order of the table."""

    def measure(self, subject: Subject) -> Figures:
        """The numbers by key.

        Raises:
            Impossible: when it cannot be made here.
            Cancelled: when nobody waits any more.
        """


MEASUREMENTS: tuple[Measurement, ...] = (surfaces, memory, dragging, training, window)
"""In the order in which they are made."""


def bench(path: Path, scope: Scope, *, device: str = "cpu", progress: Progress = SILENT) -> dict[str, Any]:
    """Measure the atlas at ``path``.

    Args:
        path: a ``.safetensors`` file of 3D shapes, of the model whose paper gives the network size.
        scope: how much to measure.
        device: where networks are evaluated and trained.
        progress: told the finished share, asked between the parts of a measurement.

    Returns:
        Plain JSON types: one entry a figure by its key, ``machine``, ``versions``, ``atlas``,
        ``definitions`` and ``targets`` by key, and ``remarks`` on what could not be measured.

    Raises:
        InputError: when the atlas cannot be read or is not one that is measured, or torch cannot compute
            on the device.
        Cancelled: when nobody waits any more.
    """
    subject = Subject(path, _measurable(Atlas.load(path, device)), scope, progress.quiet)
    measured: Figures = {}
    remarks = []
    for measurement, _ in progress.over(MEASUREMENTS):
        try:
            measured |= measurement.measure(subject)
        except Impossible as reason:
            remarks.append(str(reason))
    known = [figure for figure in figures(scope) if figure.key in measured]
    return {
        **{figure.key: measured[figure.key] for figure in known},
        "atlas": subject.atlas.name,
        "device": device,
        "machine": machine(),
        "versions": versions(),
        "definitions": {figure.key: figure.definition for figure in known},
        "targets": {figure.key: figure.target for figure in known if figure.target},
        "remarks": remarks,
    }


def figures(scope: Scope) -> tuple[Figure, ...]:
    """Every figure that a benchmark of this scope may hold, in the order of the table."""
    return tuple(figure for measurement in MEASUREMENTS for figure in measurement.figures(scope))


def _measurable(atlas: Atlas) -> Atlas:
    if atlas.frame.dim != 3:
        raise InputError("only atlases of 3D shapes are measured; give another one")
    if not isinstance(atlas.checkpoint.model(), Naisr):
        raise InputError(f"{atlas.model_title} is not measured; give an atlas of {Naisr.title}")
    return atlas


def markdown(record: Mapping[str, Any], scope: Scope) -> str:
    """The record of :func:`bench` as a Markdown table with definitions."""
    known = [figure for figure in figures(scope) if figure.key in record]
    rows = [
        [f.key, f"{record[f.key]:.4g} {f.unit}".rstrip(), f.target, f.verdict(record[f.key])] for f in known
    ]
    hardware, software = record["machine"], record["versions"]
    lines = [
        markdown_table(["figure", "measured", "target", "met"], rows),
        "\n".join(f"- {figure.key}: {figure.definition}." for figure in known),
        f"Atlas {record['atlas']}; {hardware['processor']}, {hardware['cores']} cores, "
        f"{hardware['memory_gb']:.0f} GB, {hardware['system']}; "
        + ", ".join(f"{name} {version}" for name, version in software.items())
        + f"; networks on {record['device']}, {torch.get_num_threads()} threads; "
        f"medians of {scope.repeats} runs.",
        *record["remarks"],
    ]
    return "\n\n".join(lines) + "\n"
