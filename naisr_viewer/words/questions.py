"""What is said in a question: what would be lost, in words."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from naisr_viewer.state.patients import OpenScan

NAMED = 6
"""How many files or patients are named; the rest is counted."""


def at_stake(patients: Sequence[OpenScan]) -> tuple[str, str]:
    """What would be lost with the open patients, and their names."""
    fits = sum(patient.fit is not None for patient in patients)
    lost = ", ".join(_counted(count, thing) for count, thing in ((len(patients), "patient"), (fits, "fit")))
    told = lost if fits else lost.partition(",")[0]
    return f"This closes {told}. The files stay as they are.", _listed([each.name for each in patients])


def in_the_place_of(files: Sequence[Path]) -> tuple[str, str]:
    """That files are there already, and their names."""
    count = "This file is" if len(files) == 1 else f"These {len(files)} files are"
    return f"{count} there already, in {files[0].parent}:", _listed([file.name for file in files])


def _counted(count: int, thing: str) -> str:
    return f"{count} {thing}" if count == 1 else f"{count} {thing}s"


def _listed(names: Sequence[str]) -> str:
    rest = [f"and {len(names) - NAMED} more"] if len(names) > NAMED else []
    return "\n".join([*names[:NAMED], *rest])
