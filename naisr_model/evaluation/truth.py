"""Where an atlas of a synthetic population can be held against the truth: places in covariate space."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from naisr_model.atlas import Atlas
from naisr_model.covariates import Covariate, Population
from naisr_model.evaluation.held_out import aligned, known_population, synthetic
from naisr_model.evaluation.metrics import HAUSDORFF, Pair
from naisr_model.frames import SPACE, Extent
from naisr_model.progress import SILENT, Progress

NEIGHBOURS, NEIGHBOUR_DISTANCE = 3, 0.25
EFFECT_VALUES = 9
"""At most so many places along each covariate."""


@dataclass(frozen=True)
class Place:
    """Where the atlas's shape without a code is held against the true one.

    Attributes:
        covariate: the one that varies along the path, or whose effect is shown.
        condition: what else defines the place, for example ``boys``; empty where nothing does.
        values: covariates in real units.
    """

    covariate: str
    condition: str
    values: dict[str, float]


@dataclass(frozen=True)
class TruthPoint:
    """The population shape of the atlas beside the true one, at one place in covariate space.

    Attributes:
        covariate: the one that varies along the path, or whose effect is shown.
        value: its real value.
        condition: what else defines the place, for example ``boys``; empty where nothing does.
        volume_cm3: volume of the atlas's shape at z = 0; of curves the area, in the unit of ``extent``.
        truth_cm3: the same of the true shape without individual variation.
        hd_x100: Hausdorff distance from the true shape, see :data:`~.metrics.HAUSDORFF`.
        extent: whether volumes or areas are told, and in which unit.
    """

    covariate: str
    value: float
    condition: str
    volume_cm3: float
    truth_cm3: float
    hd_x100: float
    extent: Extent = SPACE

    @property
    def volume_error(self) -> float:
        """Signed error of the volume as a share of the true one."""
        return self.volume_cm3 / self.truth_cm3 - 1

    def to_json(self) -> dict[str, Any]:
        """Its attributes and the error."""
        own = {name: value for name, value in asdict(self).items() if name not in _RENAMED}
        return {
            **own,
            self.extent.key(): self.volume_cm3,
            f"truth_{self.extent.suffix}": self.truth_cm3,
            f"{self.extent.title}_error": self.volume_error,
        }


_RENAMED = ("volume_cm3", "truth_cm3", "extent")


def truth_places(atlas: Atlas) -> dict[str, list[Place]]:
    """Places along the ``growth`` path, along each covariate (``effects``) and at the centre (``template``).

    There are none where the population is not synthetic, or shapes do not depend on covariates, and none at
    the centre where the shape there is not the template.
    """
    module = synthetic(atlas)
    if module is None or not atlas.capabilities.evolvable:
        return {"growth": [], "effects": [], "template": []}
    can, centre = atlas.capabilities, atlas.population.centre
    template = Place(atlas.covariates[0].name, "template", centre)
    effects = [
        Place(covariate.name, "", centre | {covariate.name: value})
        for covariate in atlas.covariates
        for value in plausible_values(atlas.population, covariate)
    ]
    return {
        "growth": [Place(*place) for place in module.growth_path()],
        "effects": effects,
        "template": [template] if can.has_template and can.vanishes_at_centre else [],
    }


def beside_truth(atlas: Atlas, place: Place, resolution: int, progress: Progress = SILENT) -> TruthPoint:
    """Phi(c, z = 0), which is Phi_i where only covariate i is off its centre, beside the true shape."""
    module, values = known_population(atlas), place.values
    truth = aligned(atlas, module.true_shape(values), module.true_landmarks(values))
    shape = atlas.shape(values, resolution=resolution, extrapolate=True, progress=progress)
    return TruthPoint(
        covariate=place.covariate,
        value=values[place.covariate],
        condition=place.condition,
        volume_cm3=atlas.extent.of(shape),
        truth_cm3=atlas.extent.of(truth),
        hd_x100=HAUSDORFF.measure(Pair(truth, shape)) if len(shape.faces) else float("inf"),
        extent=atlas.extent,
    )


def plausible_values(population: Population, covariate: Covariate) -> list[float]:
    """Values at which somebody in the training data is close with the others at the centre.

    Close means: at least :data:`NEIGHBOURS` training rows within :data:`NEIGHBOUR_DISTANCE` standard
    deviations over the continuous covariates. A child of a year with the mean weight of the
    cohort does not exist, and no data say what it would look like.
    """
    if covariate.kind == "binary":
        return [-1.0, 1.0]
    continuous = [i for i, other in enumerate(population.covariates) if other.kind == "continuous"]
    training = population.normalised()[~population.held_out][:, continuous]
    column = [population.covariates[i].name for i in continuous].index(covariate.name)
    plausible = []
    for value in np.linspace(*covariate.range, 8 * EFFECT_VALUES):
        place = np.zeros(len(continuous))
        place[column] = covariate.normalise(value)
        near = np.linalg.norm(training - place, axis=1) <= NEIGHBOUR_DISTANCE
        if near.sum() >= NEIGHBOURS:
            plausible.append(float(value))
    chosen = np.linspace(0, len(plausible) - 1, min(EFFECT_VALUES, len(plausible))).round().astype(int)
    return [plausible[i] for i in chosen]
