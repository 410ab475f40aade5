"""A view of one's own: the full shape, coloured by how fast it grows at this age.

A kind of view is two values: what it says of itself (a ``PanelKind``: title, hint, what it asks for, its
caption) and how its request is answered (an ``Answer``: here a surface with a number at each vertex). In the
program each is a file, in ``naisr_viewer/panels`` and in ``naisr_viewer/engine/answers``, and one line in the
registry beside it. A script adds them to both registries before it makes a window, as here.

    python a_new_view.py [FOLDER]     # writes growth.png; needs no display
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from tempfile import mkdtemp

import numpy as np

from naisr_model.progress import Progress
from naisr_model.shipped import shipped_atlas
from naisr_viewer.engine.answers.base import Answer, Source
from naisr_viewer.engine.answers.kinds import ANSWERS
from naisr_viewer.panels.base import PanelKind, ask_full_shape, caption_of
from naisr_viewer.panels.kinds import KINDS
from naisr_viewer.program import start
from naisr_viewer.program.display import ensure_display
from naisr_viewer.program.headless import take_screenshot
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.layouts import FULL_SHAPE, Layout, Panel
from naisr_viewer.state.requests import Colouring, SurfaceRequest, SurfaceResult
from naisr_viewer.words.captions import Caption, large

# %% How the request is answered.

HALF_YEAR = 6.0  # months
LIMIT_MM = 2.0  # a year, the end of the colour scale


def grown(source: Source, request: SurfaceRequest, progress: Progress) -> SurfaceResult:
    """The full shape; at rest with the speed of its surface along the normal, in mm a year.

    A point of the surface lies at the distance 0 now; half a year later it lies inside by what the surface
    has moved outwards, half a year earlier outside by the same.
    """
    shape = source.surface(replace(request, panel=FULL_SHAPE), progress)
    if not shape.is_exact or not len(shape.faces):
        return replace(shape, request=request)
    atlas, values = source.atlas(request.atlas), dict(request.values)
    later_mm, earlier_mm = (
        atlas.sdf(shape.points_mm, values | {"age": values["age"] + step}, extrapolate=True)
        for step in (HALF_YEAR, -HALF_YEAR)
    )
    speed = (earlier_mm - later_mm).astype(np.float32)
    return replace(shape, request=request, colouring=Colouring(speed, LIMIT_MM, "signed"))


# %% What the view says of itself.


def told(_atlas: AtlasCard, result: SurfaceResult) -> Caption:
    """The mean speed."""
    if result.colouring is None:
        return Caption(large("…"), "")
    mean = result.colouring.values.mean()
    return Caption(large(f"{mean:+.2f} mm a year"), "Mean speed of the surface along its normal.")


GROWTH = PanelKind(
    name="growth",
    title="Growth",
    hint="The full shape, coloured by how fast its surface moves outwards with age, in mm a year.",
    layouts=frozenset({Layout.FULL_SHAPE}),
    ask=ask_full_shape,
    caption=caption_of(told),
    colour="#8f7fd6",
    scale="signed",
    unit="mm a year",
    is_possible=lambda atlas: "age" in [covariate.name for covariate in atlas.covariates],
)

# %% Both registries, and a window as any other.

KINDS[GROWTH.name] = GROWTH
ANSWERS[GROWTH.name] = Answer(grown)


def main(folder: Path) -> None:
    """Look at a toddler's airway; write a picture of the window."""
    pixels = (1280, 800)
    ensure_display(pixels)
    engine = start.make_engine("cpu")
    card = engine.open(shipped_atlas())
    with start.own_window(engine) as (window, controller):
        window.resize(*pixels)
        window.show()
        controller.show_atlas(card, {"age": 36.0, "weight": 14.0})
        controller.set_layout(Layout.FULL_SHAPE)
        take_screenshot(window, controller, folder / "growth.png")
        colouring = controller.shown[Panel(GROWTH.name)].colouring
        assert colouring is not None
        print(f"at 36 months the airway grows by {colouring.values.mean():.2f} mm a year")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else mkdtemp()))
