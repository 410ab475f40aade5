"""Undo and redo."""

from naisr_viewer.state.history import UNDO_DEPTH, History, record, redo, undo


def test_undo_and_redo_walk_the_same_way_back_and_forth():
    visited = [(1.0,), (2.0,), (3.0,)]
    history = record(record(History(), visited[0], visited[1]), visited[1], visited[2])
    history, now = undo(history, visited[2])
    assert now == visited[1]
    history, now = undo(history, now)
    assert now == visited[0]
    assert undo(history, now) == (history, now)
    history, now = redo(history, now)
    history, now = redo(history, now)
    assert now == visited[2]
    assert redo(history, now) == (history, now)


def test_a_new_change_forgets_what_was_undone():
    history, now = undo(record(History(), (1.0,), (2.0,)), (2.0,))
    assert record(history, now, (5.0,)).future == ()
    assert record(history, now, now) is history


def test_the_undo_stack_does_not_grow_without_end():
    history = History()
    for step in range(3 * UNDO_DEPTH):
        history = record(history, (float(step),), (step + 1.0,))
    assert len(history.past) == UNDO_DEPTH
