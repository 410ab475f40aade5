"""The disentangled shape of one covariate."""

from naisr_viewer.engine.answers.base import field_of_the_model

ANSWER = field_of_the_model(
    lambda atlas, request, latent, tracker, progress: atlas.effect(
        *request.values[0], latent, request.resolution, tracker=tracker, progress=progress
    )
)
