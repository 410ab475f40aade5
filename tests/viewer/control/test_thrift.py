"""Memory is given back when the window is at rest."""

from __future__ import annotations

import gc
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


def test_free_memory_may_be_given_back_at_any_time():
    give_free_memory_back()
