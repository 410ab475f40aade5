"""What is told of an atlas."""

from __future__ import annotations

from naisr_model.covariates import Covariate, Population
from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.words.titles import label

WEAK = (
    "Where hardly anyone was seen, beyond the line under Data support, a shape is a guess and is marked so. "
    "How well an atlas reconstructs people it was not trained on, naisr evaluate tells."
)
"""Where not to trust it."""


def about_atlas(card: AtlasCard) -> tuple[str, ...]:
    """Who is behind an atlas, over what, and what it can do, in lines of plain text."""
    people = card.population
    return (
        f"Trained on {_counted(people, held_out=False)}; {_counted(people, held_out=True)} held out.",
        *(f"{label(each.name)}: {_observed(each)}" for each in card.covariates),
        *(f"Can: {told}." for told in card.capabilities.told),
        WEAK,
        f"File: {card.path}",
    )


def _observed(covariate: Covariate) -> str:
    mean = "" if covariate.kind == "binary" else f", mean {covariate.format(covariate.centre)}"
    return f"{covariate.extent}{mean}."


def _counted(people: Population, *, held_out: bool) -> str:
    """``277 shapes of 210 subjects``."""
    chosen = people.held_out == held_out
    subjects = {subject for subject, is_one in zip(people.subjects, chosen, strict=True) if is_one}
    return f"{int(chosen.sum())} shapes of {len(subjects)} subjects"
