"""The desktop program: drag age, weight and sex and watch the anatomy change."""

from naisr_model import __version__

__all__ = ["__version__"]
