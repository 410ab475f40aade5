"""Where there are data, in words."""

from __future__ import annotations

from naisr_model.covariates import Covariate, interval_in_words
from naisr_viewer.words.numbers import reading

TITLE = "Data support"
HINT = (
    "Dots: shapes behind the atlas, the visits of one person joined\n"
    "Line: where the data end, at the other covariates' values\n"
    "Triangles: patients, with 95 % around them where that was inferred\n"
    "Ring: the shapes on screen; drag it, click elsewhere or press the arrow keys"
)


def along(covariate: Covariate, stretches: tuple[tuple[float, float], ...]) -> str:
    """Where along a slider there are data: ``data from 52 to 180 months``."""
    if not stretches:
        return "No data anywhere along, at the other covariates' values"
    told = " and ".join(interval_in_words(covariate, *ends, reading) for ends in stretches)
    return f"Data along the solid part, at the other covariates' values: {told}"
