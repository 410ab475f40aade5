"""The template."""

from naisr_viewer.engine.answers.base import plain

ANSWER = plain(
    lambda atlas, request, _latent, _tracker, progress: atlas.template(request.resolution, progress=progress)
)
