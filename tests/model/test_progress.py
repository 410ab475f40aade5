"""Shares that add up, and work that stops."""

import pytest

from naisr_model.errors import Cancelled
from naisr_model.progress import SILENT, Progress


def test_pieces_of_pieces_add_up_to_the_whole():
    told: list[float] = []
    whole = Progress(told.append)
    for _, piece in whole.over("ab"):
        for _, smaller in piece.part(0.5, 1.0).over("cde"):
            smaller.tell(0.5)
    assert told == sorted(told) and told[-1] == 1.0
    sixths = [0.25 + n / 12 for n in (0.5, 1, 1.5, 2, 2.5, 3)]
    assert told == pytest.approx([*sixths, 0.5, *(0.5 + share for share in sixths), 1.0])


def test_work_ends_before_the_next_item_once_nobody_waits():
    done: list[str] = []
    with pytest.raises(Cancelled):
        for item, piece in Progress(is_unwanted=lambda: len(done) == 2).over("abc"):
            piece.check()
            done.append(item)
    assert done == ["a", "b"]


def test_a_quiet_piece_tells_nothing_and_still_stops():
    quiet = Progress(lambda _: pytest.fail("told"), lambda: True).quiet
    quiet.tell(0.5)
    with pytest.raises(Cancelled):
        quiet.part(0, 1).check()


def test_nothing_to_do_is_fine():
    assert list(SILENT.over(())) == []
