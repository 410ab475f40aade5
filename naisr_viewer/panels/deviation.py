"""How a fitted patient differs from the population's average at the same covariates."""

from naisr_viewer.panels import shape
from naisr_viewer.panels.base import PanelKind, ask_full_shape, caption_of
from naisr_viewer.state.layouts import Layout
from naisr_viewer.state.requests import SurfaceResult
from naisr_viewer.words.captions import LATER, Caption, beyond, large

HINT = (
    "Distance of the patient's surface to that of the population's average at the same covariates, in mm: "
    "positive where the patient's lies outside."
)


def _extremes(result: SurfaceResult) -> Caption:
    hint = HINT + (LATER if result.request.values else "")
    if result.colouring is None:
        return Caption(large("…"), hint)
    inside, outside = result.colouring.values.min(), result.colouring.values.max()
    ends = f"{inside:+.1f} to {outside:+.1f} mm".replace("-", "−")
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
