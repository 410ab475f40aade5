"""The full shape; also the one that changes are counted from."""

from naisr_viewer.engine.answers.base import field_of_the_model

ANSWER = field_of_the_model(
    lambda atlas, request, latent, tracker, progress: atlas.shape(
        dict(request.values), latent, request.resolution, tracker=tracker, progress=progress
    )
)
