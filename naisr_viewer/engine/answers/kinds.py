"""How each kind of view is answered, by its name."""

from __future__ import annotations

from naisr_viewer.engine.answers import (
    change,
    deviation,
    effect,
    matrix,
    scan,
    scans,
    shape,
    template,
    uncertainty,
    unusual,
)
from naisr_viewer.engine.answers.base import Answer

ANSWERS: dict[str, Answer] = {
    "template": template.ANSWER,
    "effect": effect.ANSWER,
    "before": shape.ANSWER,
    "shape": shape.ANSWER,
    "scan": scan.ANSWER,
    "uncertainty": uncertainty.ANSWER,
    "deviation": deviation.ANSWER,
    "unusual": unusual.ANSWER,
    "change": change.ANSWER,
    "scans": scans.ANSWER,
    "matrix": matrix.ANSWER,
}
"""One line a kind, as among the panels."""
