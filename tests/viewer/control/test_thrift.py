"""Memory is given back when the window is at rest."""

from __future__ import annotations

import gc
import threading
import weakref

from naisr_viewer.control.thrift import give_free_memory_back


class Ring:
    """Refers to itself, as a mesh does by way of what belongs to it."""

    def __init__(self):
        self.me = self


def test_what_refers_to_itself_is_freed_after_a_rest(qtbot, open_window, card):
    assert not gc.isenabled()
    _, controller = open_window()
    ring = weakref.ref(Ring())
    assert ring() is not None
    controller.show_atlas(card)
    qtbot.waitUntil(lambda: ring() is None, timeout=30_000)


def test_garbage_is_collected_by_the_thread_of_the_window_while_another_works(
    qtbot, open_window, atlas, card
):
    _, controller = open_window()
    atlas.gate.clear()
    controller.show_atlas(card)
    collectors: list[str] = []
    ring = Ring()
    watched = weakref.ref(ring, lambda _: collectors.append(threading.current_thread().name))
    del ring
    qtbot.waitUntil(lambda: watched() is None)
    assert collectors == [threading.main_thread().name]
    assert controller.is_busy
    atlas.gate.set()
    qtbot.waitUntil(lambda: not controller.is_busy)


def test_free_memory_may_be_given_back_at_any_time():
    give_free_memory_back()
