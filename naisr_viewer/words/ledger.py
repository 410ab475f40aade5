"""What moved a pinned place, in words."""

from __future__ import annotations

from naisr_viewer.state.pins import Entry, Part
from naisr_viewer.words.numbers import length, margin, way
from naisr_viewer.words.titles import label

PERSON, SUM = "This person", "Together"

HINT = (
    "How far this place of the full shape has come from the template, cause by cause, along the outward "
    "normal: + outwards, − inwards. The causes add up. Behind ± stands half of the 95 % interval, where the "
    "people behind the atlas tell it; a bar is pale where they do not tell the effect from nothing."
)
INVITATION = (
    "Click on a shape to pin a place, up to three. It is marked in every shape, and here stands what each "
    "covariate does to it. Esc removes the pins."
)
NO_PLACE = "The deformation folds at this place: it has no one place in the full shape."


def title(number: int) -> str:
    """Of a pinned place."""
    return f"Place {number}"


def lines(entry: Entry) -> tuple[tuple[str, Part], ...]:
    """The parts of an entry with what they are called, the sum last."""
    causes = [(label(part.cause), part) for part in entry.parts]
    person = [] if entry.person is None else [(PERSON, entry.person)]
    return (*causes, *person, (SUM, entry.total))


def across(part: Part, unit: str) -> str:
    """The way along the normal, with half of its 95 % interval where that is known."""
    if part.margin_mm is None:
        return way(part.normal_mm, unit)
    return margin(part.normal_mm, part.margin_mm, unit)


def along(part: Part, unit: str) -> str:
    """The rest of the way, which the shape's outline does not show."""
    return f"{length(part.tangential_mm, unit)} along it"


def told(entry: Entry, unit: str) -> str:
    """All of an entry, for who hovers over it or has it read aloud."""
    rows = [f"{name}: {_line(part, unit)}" for name, part in lines(entry)]
    return "\n".join([title(entry.pin.number), *rows])


def _line(part: Part, unit: str) -> str:
    doubt = "" if part.is_told else ", not told from nothing"
    return f"{across(part, unit)}{doubt}, {along(part, unit)}"
