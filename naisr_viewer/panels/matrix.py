"""A cell of the matrix: the shape at one value of each of two covariates, or of one of them alone."""

from naisr_viewer.panels import shape
from naisr_viewer.panels.base import PanelKind, asked, caption_of
from naisr_viewer.panels.shape import enclosed
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.explorer import ExplorerState, at_cell
from naisr_viewer.state.layouts import Cell, Layout, Panel
from naisr_viewer.state.matrix import (
    MOST_COLUMNS,
    MOST_ROWS,
    Matrix,
    cells_of,
    distance,
    is_inner,
    nearest,
    own_values,
)
from naisr_viewer.state.requests import SurfaceRequest, SurfaceResult
from naisr_viewer.words.captions import Caption
from naisr_viewer.words.numbers import volume


def _ask(state: ExplorerState, panel: Panel, resolution: int) -> SurfaceRequest:
    """On an axis for what depends on its own covariate alone, and where the axes meet for the template."""
    matrix, cell = _place(state, panel)
    if is_inner(cell):
        return asked(state, panel, resolution, at_cell(state, cell).named, state.person)
    own = own_values(matrix, cell)
    return asked(state, panel, resolution, tuple(own.items()), state.person if own else 0)


TEMPLATE = Caption("template", "The shape from which all others are made; both axes begin with it.")


def _volume(atlas: AtlasCard, result: SurfaceResult) -> Caption:
    text = volume(result.extent, result.extent_margin, atlas.frame.extent)
    told = Caption(text, enclosed(atlas, result).hint)
    return told if result.request.values else TEMPLATE.beneath(told)


def here(state: ExplorerState) -> Panel | None:
    """The cell that is nearest to the present covariates; None without a matrix."""
    if state.atlas is None or state.matrix is None:
        return None
    return Panel(KIND.name, cell=nearest(state.atlas, state.matrix, state.values))


def is_pale(state: ExplorerState, panel: Panel) -> bool:
    """Whether hardly anyone behind the atlas is near the covariates of a cell."""
    assert state.atlas is not None
    return not state.atlas.population.has_data_at(dict(_ask(state, panel, 0).values))


def _is_there(state: ExplorerState, panel: Panel) -> bool:
    return state.matrix is not None and panel.cell in cells_of(state.matrix)


def _away(state: ExplorerState, panel: Panel) -> float:
    """From the present covariates."""
    assert state.atlas is not None
    return distance(state.atlas, *_place(state, panel), state.values)


def _place(state: ExplorerState, panel: Panel) -> tuple[Matrix, Cell]:
    assert state.matrix is not None
    assert panel.cell is not None
    return state.matrix, panel.cell


def _is_possible(atlas: AtlasCard) -> bool:
    """The axes are effects that meet at the template."""
    can = atlas.capabilities
    return can.disentangleable and can.has_template and len(atlas.covariates) > 1


KIND = PanelKind(
    name="matrix",
    title="Matrix",
    hint="Shapes at many values of two covariates at once; the first row and column are of each alone.",
    layouts=frozenset({Layout.MATRIX}),
    ask=_ask,
    caption=caption_of(_volume),
    colour=shape.COLOUR,
    cells=tuple((column, row) for row in range(MOST_ROWS + 1) for column in range(MOST_COLUMNS + 1)),
    is_possible=_is_possible,
    is_there=_is_there,
    away=_away,
)
