"""What covariates are called, and how names that people gave are shown as they are."""

from __future__ import annotations

import html


def label(name: str) -> str:
    """A covariate's name as people read it: ``body_weight`` is ``Body weight``."""
    words = " ".join(name.replace("_", " ").split())
    return words[:1].upper() + words[1:]


def as_tip(text: str) -> str:
    """``text`` for a tool tip, shown as it is written: Qt takes words such as ``<b>`` there for markup."""
    if "<" not in text and "&" not in text:
        return text
    return f"<p style='white-space: pre-wrap'>{html.escape(text, quote=False)}</p>"


def as_entry(text: str) -> str:
    """``text`` for a menu, a button or a tick box, where ``&`` would underline the letter behind it."""
    return text.replace("&", "&&")
