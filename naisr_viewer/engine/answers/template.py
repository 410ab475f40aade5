"""The template."""

from naisr_viewer.engine.answers.base import field_of_the_model

ANSWER = field_of_the_model(
    lambda atlas, request, _latent, _tracker, progress: atlas.template(request.resolution, progress=progress)
)
