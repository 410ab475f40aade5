"""What is asked before something is done that cannot be undone, as values."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Question:
    """Asked until the user wants it no more.

    Attributes:
        name: in the user's settings.
        title: of the dialog.
        go_on: the button that goes on.
        when: what the preferences say of it, after "Ask before", with its key after ``&``.
        unattended: the answer where nobody can be asked.
    """

    name: str
    title: str
    go_on: str
    when: str
    unattended: bool


@dataclass(frozen=True)
class Answer:
    """What the user said.

    Attributes:
        goes_on: whether it shall be done.
        is_last: whether it shall not be asked again.
    """

    goes_on: bool
    is_last: bool = False


OPEN_ATLAS = Question(
    "open atlas",
    "Open another atlas",
    "Open",
    "&another atlas takes the place of open patients",
    unattended=True,
)
CLOSE_WINDOW = Question(
    "close window", "Close the window", "Close", "the &window is closed with open patients", unattended=True
)
REPLACE_FILES = Question("replace files", "Replace files", "Replace", "&files are replaced", unattended=False)

QUESTIONS = (OPEN_ATLAS, CLOSE_WINDOW, REPLACE_FILES)
"""All of them; the preferences list them."""
