"""Whether shapes can be drawn here: where they cannot, VTK ends the process, or draws nothing in silence."""

from __future__ import annotations

from PySide6.QtGui import QGuiApplication, QOffscreenSurface, QOpenGLContext, QSurfaceFormat

from naisr_model.errors import InputError

LEAST = (3, 2)
"""Version of OpenGL that VTK draws with."""


def require_opengl() -> None:
    """Make sure that the display can draw; there is an application object.

    Raises:
        InputError: when it has no OpenGL, or one that is too old.
    """
    wanted = QSurfaceFormat()
    wanted.setRenderableType(QSurfaceFormat.RenderableType.OpenGL)
    wanted.setProfile(QSurfaceFormat.OpenGLContextProfile.CoreProfile)
    wanted.setVersion(*LEAST)
    surface, context = QOffscreenSurface(), QOpenGLContext()
    surface.setFormat(wanted)
    surface.create()
    context.setFormat(wanted)
    is_there = context.create() and context.makeCurrent(surface)
    offered = context.format().version() if is_there else None
    context.doneCurrent()
    if offered is None or tuple(offered) < LEAST:
        raise InputError(_refusal(offered))


def _refusal(offered: tuple[int, int] | None) -> str:
    what = "no OpenGL" if offered is None else f"OpenGL {offered[0]}.{offered[1]}"
    return (
        f"this display ({QGuiApplication.platformName()}) offers {what}, and shapes are drawn with "
        f"{LEAST[0]}.{LEAST[1]} or newer; update its graphics driver, or set LIBGL_ALWAYS_SOFTWARE=1"
    )
