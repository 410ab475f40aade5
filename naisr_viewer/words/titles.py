"""What covariates are called."""

from __future__ import annotations


def label(name: str) -> str:
    """A covariate's name as people read it: ``body_weight`` is ``Body weight``."""
    words = name.replace("_", " ").strip()
    return words[:1].upper() + words[1:]
