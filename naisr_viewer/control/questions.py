"""Asks before what cannot be undone, as often as its user wants."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from naisr_viewer.control.preferences import Preferences
from naisr_viewer.state.patients import OpenScan
from naisr_viewer.state.questions import QUESTIONS, REPLACE_FILES, Question
from naisr_viewer.views.main_window import MainWindow
from naisr_viewer.words.questions import at_stake, in_the_place_of


class Questions:
    """What is asked, and what is not asked any more.

    Args:
        window: shows the questions.
        preferences: which of them are wanted.
        is_attended: whether somebody sits there who can answer; nothing waits for an answer otherwise.
    """

    def __init__(self, window: MainWindow, preferences: Preferences, is_attended: bool) -> None:
        self._window, self._preferences, self.is_attended = window, preferences, is_attended

    def may_lose(self, question: Question, patients: Sequence[OpenScan]) -> bool:
        """Whether something shall be done that closes the open patients."""
        return not patients or self._agrees(question, *at_stake(patients))

    def may_replace(self, files: Sequence[Path]) -> bool:
        """Whether files that are there already shall be replaced; where nobody sits that is an error."""
        if not files or self._agrees(REPLACE_FILES, *in_the_place_of(files)):
            return True
        if not self.is_attended:
            self._window.show_error(f"{files[0]} is there already; nothing was written.")
        return False

    def change(self) -> None:
        """Let the user say which questions are wanted."""
        chosen = self._window.ask_preferences({each: self._preferences.asks(each) for each in QUESTIONS})
        for question, is_asked in (chosen or {}).items():
            self._preferences.set_asks(question, is_asked)

    def _agrees(self, question: Question, text: str, detail: str) -> bool:
        """Whether it shall be done; not to be asked again counts only with a yes."""
        if not self._preferences.asks(question):
            return True
        if not self.is_attended:
            return question.unattended
        answer = self._window.ask(question, text, detail)
        if answer.goes_on and answer.is_last:
            self._preferences.set_asks(question, False)
        return answer.goes_on
