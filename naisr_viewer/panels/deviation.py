"""How a fitted patient differs from the population's average at the same covariates."""

from naisr_viewer.panels import shape
from naisr_viewer.panels.base import PanelKind, ask_full_shape, caption_of
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.layouts import Layout
from naisr_viewer.state.requests import SurfaceResult
from naisr_viewer.words.captions import LATER, Caption, beyond, large
from naisr_viewer.words.numbers import MILLIMETRES

HINT = (
    "Distance of the patient's surface to that of the population's average at the same covariates, in mm: "
    "positive where the patient's lies outside."
)


def _extremes(atlas: AtlasCard, result: SurfaceResult) -> Caption:
    hint = HINT + (LATER if result.request.values else "")
    if result.colouring is None:
        return Caption(large("…"), hint)
    inside, outside = result.colouring.values.min(), result.colouring.values.max()
    unit = atlas.frame.unit
    decimals = 1 if unit == MILLIMETRES else 3
    ends = f"{inside:+.{decimals}f} to {outside:+.{decimals}f} {unit}".replace("-", "−")
    return Caption(large(ends) + f"<br>from the average{beyond(result.colouring)}", hint)


KIND = PanelKind(
    name="deviation",
    title="Deviation",
    hint=(
        "The full shape, coloured by its distance to the population's average at the same covariates in mm:\n"
        "orange where it lies outside (+), blue where it lies inside (−)."
    ),
    layouts=frozenset({Layout.FIT}),
    ask=ask_full_shape,
    caption=caption_of(_extremes),
    colour=shape.COLOUR,
    scale="signed",
)
