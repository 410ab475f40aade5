"""The full shape, Phi."""

from naisr_viewer.panels.base import PanelKind, ask_full_shape, caption_of
from naisr_viewer.state.layouts import FULL_SHAPE, Layout
from naisr_viewer.state.requests import SurfaceResult
from naisr_viewer.words.captions import LATER, Caption, large
from naisr_viewer.words.numbers import volume

COLOUR = "#6f9fe8"


def enclosed(result: SurfaceResult) -> Caption:
    """The volume of a surface, with the margin of a person's."""
    later = LATER if result.request.values else ""
    within = "" if result.volume_margin_cm3 is None else f", ± half of its 95 % interval.{later}"
    return Caption(large(volume(result.volume_cm3, result.volume_margin_cm3)), f"Enclosed volume{within}")


KIND = PanelKind(
    name=FULL_SHAPE.kind,
    title="Full shape",
    hint="The shape at all covariates together.",
    layouts=frozenset(Layout) - {Layout.MATRIX},
    ask=ask_full_shape,
    caption=caption_of(enclosed),
    colour=COLOUR,
)
