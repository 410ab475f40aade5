"""What a shape model can do: known without the model, so that others may ask."""

from __future__ import annotations

from dataclasses import dataclass

CAN = {
    "implicit": "surfaces at any resolution",
    "deformable": "points of different shapes correspond",
    "disentangleable": "the effect of each covariate alone can be seen",
    "additive": "the covariates' displacements add up",
    "evolvable": "shapes can be followed along covariates",
    "transferable": "a patient can be seen on another day",
    "stepwise": "deformations are followed step by step",
    "invertible": "deformations cannot fold",
    "has_template": "there is a template that all shapes are deformed from",
    "vanishes_at_centre": "at the centre of the covariates every shape is the template",
}
"""What each capability means to whoever uses an atlas."""


@dataclass(frozen=True)
class Capabilities:
    """What a model can do, in the terms of Table 1 of Jiao et al. (ICLR 2024), and some facts about it.

    Attributes:
        implicit: a shape is the zero level set of a field that is defined everywhere.
        deformable: that field is a template's at points that were moved, so that shapes correspond.
        disentangleable: the shape of one covariate alone can be shown.
        additive: the displacements of the covariates add up to that of the shape.
        evolvable: shapes depend on covariates and can be followed along them.
        transferable: a person's shape is known at other covariates than those at which it was seen.
        stepwise: points are moved step by step, and the template is asked underway as well.
        invertible: p -> p + d(p) cannot fold.
        has_template: there is a shape T that all others are deformed from.
        vanishes_at_centre: nothing is displaced where all covariates are at their centre, whatever the
            code is: g_i(p, 0, z) = 0, and the shape there is the template.
    """

    implicit: bool = True
    deformable: bool = False
    disentangleable: bool = False
    additive: bool = False
    evolvable: bool = False
    transferable: bool = False
    stepwise: bool = False
    invertible: bool = False
    has_template: bool = False
    vanishes_at_centre: bool = False

    @property
    def trackable(self) -> bool:
        """Whether the template's surface can be carried to a shape from tables of displacements."""
        return self.deformable and self.additive and self.vanishes_at_centre

    @property
    def told(self) -> tuple[str, ...]:
        """What the model can do, in words."""
        return tuple(told for name, told in CAN.items() if getattr(self, name))
