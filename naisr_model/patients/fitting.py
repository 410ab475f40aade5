"""A patient that was taken in, fitted where it lies, or better."""

from __future__ import annotations

from naisr_model.atlas import Atlas, Fit
from naisr_model.covariates import Values
from naisr_model.patients.intake import Intake, relaid
from naisr_model.progress import SILENT, Progress

ROUNDS = 3
"""How often at most a patient is laid onto its own fit and fitted again; the first does most of it."""

GAIN = 0.9
"""Of the residual: another round is kept where it comes down to this share or less."""


def fitted_in_place(
    intake: Intake, atlas: Atlas, known: Values, *, progress: Progress = SILENT
) -> tuple[Fit, Intake]:
    """Fit a patient; one that was aligned by closest points is laid onto its own fit and fitted again.

    Closest points lay a patient onto the atlas's average, from which it differs: what is left of the wrong
    place goes into covariates and code, which then tell of it as if it were anatomy. So the place is sought
    again together with them, see :mod:`~naisr_model.learning.fitting.placing`.

    Args:
        intake: ready to be fitted; it is not changed.
        atlas: of which it is in the frame.
        known: covariates in real units; the others are inferred.
        progress: told the finished share, checked between steps.

    Returns:
        The fit, and the patient as it lay for it.

    Raises:
        InputError: for an unknown covariate or one out of range.
        Cancelled: when nobody waits any more.
    """
    rounds = ROUNDS if intake.method == "icp" else 0
    best: tuple[Fit, Intake] | None = None
    for _, piece in progress.over(range(1 + rounds)):
        lies = intake if best is None else _laid(*best, atlas, piece.quiet)
        fit = atlas.fit(lies.patient.mesh_mm, known, progress=piece)
        if best is not None and fit.residual_mm > GAIN * best[0].residual_mm:
            break
        best = fit, lies
    assert best is not None
    progress.tell(1.0)
    return best


def _laid(fit: Fit, lies: Intake, atlas: Atlas, progress: Progress) -> Intake:
    return relaid(lies, atlas, fit.motion_mm(lies.patient.mesh_mm, progress=progress))
