"""How sure the surface of a fitted patient is."""

from naisr_viewer.panels import shape
from naisr_viewer.panels.base import PanelKind, ask_full_shape, caption_of
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.layouts import Layout
from naisr_viewer.state.requests import SurfaceResult
from naisr_viewer.words.captions import Caption, beyond, large
from naisr_viewer.words.numbers import length

HINT = (
    "Half of the 95 % interval of the surface's place along its normal, in mm, for someone known by one "
    "scan; the interval of the volume stands under the full shape."
)


def _mean_margin(atlas: AtlasCard, result: SurfaceResult) -> Caption:
    if result.colouring is None:
        return Caption(large("…"), HINT)
    mean_mm = result.colouring.values.mean()
    told = f"<br>mean 95 % margin{beyond(result.colouring)}"
    return Caption(large(f"± {length(float(mean_mm), atlas.frame.unit)}") + told, HINT)


KIND = PanelKind(
    name="uncertainty",
    title="Uncertainty",
    hint=(
        "The full shape, coloured by how far its surface may lie off in mm:\n"
        "half of the 95 % interval of its place, inwards or outwards."
    ),
    layouts=frozenset({Layout.FIT}),
    ask=ask_full_shape,
    caption=caption_of(_mean_margin),
    colour=shape.COLOUR,
    scale="unsigned",
)
