"""What lines beneath sub-plots have in common."""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np

from naisr_viewer.state.requests import Colouring

WORTH_TELLING = 0.05
"""Share of a surface beyond its colour scale from which on that is said."""


class Caption(NamedTuple):
    """Rich text for beneath a surface, and a hint for who hovers over it."""

    text: str
    hint: str

    def beneath(self, measured: Caption) -> Caption:
        """Said below what was ``measured``, whose hint it replaces."""
        return Caption(f"{measured.text}<br>{self.text}", self.hint)


NO_SURFACE = Caption("no surface at these values", "The signed distance is nowhere zero inside the box.")
DOUBTFUL = Caption(
    "preview uncertain",
    "The deformation folds here, so the preview may lack or invent pieces; the exact surface follows at "
    "rest.",
)
UNSEEN = Caption(
    "outside the data",
    "Hardly anyone behind the atlas is near this combination of covariates (those not moved here are at "
    "their mean), so the shape is a guess.",
)
NOT_VALID = Caption(
    "not valid",
    "The fit missed the scan, so this is nobody's shape, and its volume says nothing of the patient: align "
    "the scan to the atlas and fit it again, and check that it is such a shape.",
)
LATER = (
    "\nAway from the patient's own covariates another day is meant: what sets the patient apart is kept only "
    "as far as it is expected to last."
)


def lines_of(caption: Caption) -> tuple[str, ...]:
    """What stands beneath a surface, as plain lines."""
    return tuple(re.sub(r"<[^>]+>", "", line) for line in caption.text.split("<br>"))


def large(text: str) -> str:
    """The figure that is read first."""
    return f'<span style="font-size:12pt">{text}</span>'


def small(text: str) -> str:
    """Words that have little room."""
    return f'<span style="font-size:8pt">{text}</span>' if text else ""


def beyond(colouring: Colouring) -> str:
    """A colour at the end of its scale says less than it seems to; empty where hardly any is."""
    share = float((np.abs(colouring.values) > colouring.limit).mean())
    return f" · {100 * share:.0f}\u00a0% beyond the scale" if share > WORTH_TELLING else ""
