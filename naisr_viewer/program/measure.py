"""How long a person waits: the window timed from the outside, with real mouse events.

What is written:

- ``window_visible_s``: from the start of the process to the first painting of the window.
- ``first_picture_s``: from the start of the process until all views are exact and painted.
- ``first_picture_was_kept``: whether that picture's surface came from the cache of an earlier run.
- ``previews_ready_s``: from the start of the process until previews are fast; null if that took too long.
- ``covariate``, ``views``: whose slider was dragged, the others being off their centre, and how many
  sub-plots were on screen.
- ``events``, ``frames``: how often the slider changed while the mouse was down, and how many pictures
  with a new value were painted meanwhile.
- ``frames_dropped``: how many values were overtaken by a newer one before they were painted.
- ``event_to_picture_median_ms``, ``event_to_picture_p95_ms``: from a change of the slider to the first
  painted picture of that value or a later one.
- ``queue_after_drag``: how many more pictures of earlier values came after the mouse was released.
- ``release_to_exact_s``: from the release of the mouse until all views are exact and painted.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PySide6.QtCore import QEventLoop, Qt, QTimer

from naisr_model.errors import InputError
from naisr_model.files import replacing
from naisr_viewer.control.controller import Controller
from naisr_viewer.engine.engine import Engine
from naisr_viewer.panels.kinds import request_for, visible_panels
from naisr_viewer.state.layouts import FULL_SHAPE, Panel
from naisr_viewer.state.requests import EXACT_RESOLUTION
from naisr_viewer.views.covariates.row import CovariateRow
from naisr_viewer.views.covariates.slider import chosen_value
from naisr_viewer.views.main_window import MainWindow

DRAG_S = 5.0
EVENTS_PER_S = 60
SWING_S = 1.2
"""From one end of a slider to the other."""

PATIENCE_S = 300.0
PREVIEWS_S = 60.0
"""How long fast previews are waited for before the slider is dragged."""

POLL_MS = 5


@dataclass(frozen=True)
class Picture:
    """A painting of the shapes.

    Attributes:
        time: when it was on screen, on the monotonic clock.
        values: the dragged covariate in every sub-plot that depends on it.
        complete: whether all of the window was exact.
    """

    time: float
    values: tuple[float, ...]
    complete: bool


def process_start(loaded: float) -> float:
    """When this process was created, on the monotonic clock; ``loaded`` where the system does not tell."""
    try:
        fields = Path("/proc/self/stat").read_text().rpartition(")")[2].split()
        age_s = time.clock_gettime(time.CLOCK_BOOTTIME) - int(fields[19]) / os.sysconf("SC_CLK_TCK")
    except (OSError, AttributeError, ValueError):
        return loaded
    return time.monotonic() - age_s


def swing(seconds: float) -> float:
    """Where the handle is after so long: from one end of the slider to the other and back, 0 to 1."""
    phase = (seconds / SWING_S + 0.5) % 2.0
    return phase if phase <= 1.0 else 2.0 - phase


def first_shown(
    events: Sequence[tuple[float, float]], pictures: Sequence[Picture]
) -> list[tuple[float, float]]:
    """When each change of the slider was answered.

    Args:
        events: time and value of every change, in order.
        pictures: paintings in order.

    Returns:
        Time of the change and time of the first picture that shows its value or a later one. Changes
        that no picture answers are left out.
    """
    answered: list[tuple[float, float]] = []
    last: tuple[float, ...] = ()
    for picture in pictures:
        if picture.values and picture.values != last:
            open_ones = [event for event in events[len(answered) :] if event[0] <= picture.time]
            newest = min(_count_until(open_ones, value) for value in picture.values)
            answered += [(moment, picture.time) for moment, _ in open_ones[:newest]]
            last = picture.values
    return answered


def _count_until(events: Sequence[tuple[float, float]], value: float) -> int:
    """How many events there are up to the first with ``value``; none without one."""
    return next((place for place, event in enumerate(events, start=1) if event[1] == value), 0)


class Observer:
    """Notes what was painted when."""

    def __init__(self, window: MainWindow, controller: Controller) -> None:
        self._window, self._controller = window, controller
        self.appeared: float | None = None
        self.name = ""
        self.pictures: list[Picture] = []
        window.appeared.connect(self._note_appearance)
        # Queued, so that what was painted has reached the screen by then.
        window.shapes.drawn.connect(self._note_picture, Qt.ConnectionType.QueuedConnection)

    def complete_since(self, moment: float) -> float | None:
        """When the first complete picture after ``moment`` was painted."""
        return next((each.time for each in self.pictures if each.complete and each.time > moment), None)

    def _note_appearance(self) -> None:
        self.appeared = time.monotonic()

    def _note_picture(self, _count: int) -> None:
        shown = self._controller.shown
        depends = [panel for panel in (Panel("effect", self.name), FULL_SHAPE) if panel in shown]
        values = tuple(dict(shown[panel].request.values).get(self.name, float("nan")) for panel in depends)
        self.pictures.append(Picture(time.monotonic(), values if self.name else (), self._is_complete()))

    def _is_complete(self) -> bool:
        state, shown = self._controller.state, self._controller.shown
        return state.atlas is not None and all(
            panel in shown
            and shown[panel].is_exact
            and shown[panel].request == request_for(state, panel, EXACT_RESOLUTION)
            for panel in visible_panels(state)
        )


def measure(
    window: MainWindow, controller: Controller, engine: Engine, observer: Observer, started: float, file: Path
) -> None:
    """Wait for the first picture, drag a slider and write what was observed.

    Args:
        window: on its way to the screen.
        controller: drives the window.
        engine: tells when previews are fast.
        observer: has watched the window since before it was shown.
        started: when the process was, on the monotonic clock.
        file: the JSON file to write.

    Raises:
        InputError: when the window reports an error, or nothing happens for too long.
    """
    _wait(lambda: observer.complete_since(0.0) is not None or bool(window.error_text.text()))
    first = observer.complete_since(0.0)
    if first is None or observer.appeared is None or controller.state.atlas is None:
        raise InputError(window.error_text.text() or f"no picture within {PATIENCE_S:g} s")
    card, atlas = controller.state.atlas, controller.state.atlas.path
    if not card.covariates:
        raise InputError(f"the shapes of {atlas.name} depend on no covariate, so no slider can be dragged")
    ready = card.capabilities.trackable and _wait(lambda: engine.has_previews(atlas), PREVIEWS_S)
    previews_ready_s = time.monotonic() - started if ready else None
    observer.name, row = next(iter(window.covariates.rows.items()))
    _leave_the_centre(controller, observer)
    events, released = _drag(row)
    _wait(lambda: observer.complete_since(released) is not None)
    figures = {
        "window_visible_s": observer.appeared - started,
        "first_picture_s": first - started,
        "first_picture_was_kept": engine.was_kept(atlas),
        "previews_ready_s": previews_ready_s,
        **_figures(observer, events, released, len(visible_panels(controller.state))),
    }
    text = json.dumps(figures, indent=2) + "\n"
    with replacing(file) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _leave_the_centre(controller: Controller, observer: Observer) -> None:
    """Move what is not dragged: at the centre the full shape would be the dragged effect, and free."""
    assert controller.state.atlas is not None
    moment = time.monotonic()
    for covariate in controller.state.atlas.covariates:
        if covariate.name != observer.name:
            controller.settle(covariate.name, (covariate.centre + covariate.range[1]) / 2)
    _wait(lambda: observer.complete_since(moment) is not None)


def _figures(
    observer: Observer, events: Sequence[tuple[float, float]], released: float, views: int
) -> dict[str, object]:
    if not events:
        raise InputError("the slider did not move while it was dragged; the machine is too busy to measure")
    during = [picture for picture in observer.pictures if events[0][0] <= picture.time <= released]
    after = [picture for picture in observer.pictures if picture.time > released]
    late = {picture.values for picture in after if any(value != events[-1][1] for value in picture.values)}
    waits_ms = [1000 * (shown - moment) for moment, shown in first_shown(events, observer.pictures)]
    # Of the inverse of the distribution: waits that there were, none between two of them.
    median_ms, p95_ms = np.percentile(waits_ms, [50, 95], method="inverted_cdf").tolist()
    frames = len({picture.values for picture in during})
    exact = observer.complete_since(released)
    if exact is None:
        raise InputError(f"the picture did not become exact within {PATIENCE_S:g} s")
    return {
        "covariate": observer.name,
        "views": views,
        "events": len(events),
        "frames": frames,
        "frames_dropped": len(events) - frames,
        "event_to_picture_median_ms": median_ms,
        "event_to_picture_p95_ms": p95_ms,
        "queue_after_drag": len(late - {picture.values for picture in during[-1:]}),
        "release_to_exact_s": exact - released,
    }


def _drag(row: CovariateRow) -> tuple[list[tuple[float, float]], float]:
    """Drag a slider back and forth at the pace of a real mouse.

    Returns:
        Time and value of the slider's changes, and when the mouse was released. A change that comes
        late because the window was busy counts from when it was due.
    """
    from PySide6.QtTest import QTest

    slider, changes = row.slider, list[tuple[float, float]]()
    left = Qt.MouseButton.LeftButton
    begin = time.monotonic()
    timer = QTimer(timerType=Qt.TimerType.PreciseTimer, interval=round(1000 / EVENTS_PER_S))
    loop = QEventLoop()

    def move() -> None:
        now = time.monotonic() - begin
        due = int(now * EVENTS_PER_S) / EVENTS_PER_S
        if now > DRAG_S:
            loop.quit()
            return
        before = chosen_value(row.covariate, slider.sliderPosition())
        QTest.mouseMove(slider, slider.place_of(swing(due)))
        if (value := chosen_value(row.covariate, slider.sliderPosition())) != before:
            changes.append((begin + due, value))

    QTest.mousePress(slider, left, pos=slider.place_of(swing(0.0)))
    timer.timeout.connect(move)
    timer.start()
    loop.exec()
    timer.stop()
    released = time.monotonic()
    QTest.mouseRelease(slider, left, pos=slider.place_of(swing(DRAG_S)))
    return changes, released


def _wait(condition: Callable[[], bool], seconds: float = PATIENCE_S) -> bool:
    """Run the window until ``condition`` holds; False when it does not within ``seconds``."""
    end, loop, timer = time.monotonic() + seconds, QEventLoop(), QTimer(interval=POLL_MS)
    timer.timeout.connect(lambda: loop.quit() if condition() or time.monotonic() > end else None)
    timer.start()
    loop.exec()
    timer.stop()
    return condition()
