"""What a table says of the open scans, and who is left to be fitted."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from naisr_viewer.state.explorer import ExplorerState, opened, unfitted, with_patient, with_stated
from naisr_viewer.state.patients import Fitted, OpenScan, Reading, Scan, Stated

NOTHING = np.zeros((0, 3), np.float32)
FIT = Fitted(7, (("age", 84.0),), (), 40.0, 1.0, 0.1, 0.5, 1.0)


def patient(key: int, name: str, fit: Fitted | None = None, blocked: str = "") -> OpenScan:
    scan = Scan(NOTHING, NOTHING, np.zeros((0, 3), np.int64), name, blocked=blocked)
    return OpenScan(key, name, Reading(Path("/scans") / name), scan, fit=fit)


def of(card, *patients: OpenScan) -> ExplorerState:
    state = opened(ExplorerState(), card)
    for each in patients:
        state = with_patient(state, each)
    return state


def known_of(state: ExplorerState) -> list[tuple[tuple[str, float], ...]]:
    return [each.known for each in state.patients]


def test_the_shown_one_is_fitted_last_and_neither_the_fitted_nor_the_blocked(card):
    state = of(card, patient(1, "a"), patient(2, "b", FIT), patient(3, "c", blocked="far"), patient(4, "d"))
    state = replace(state, patient=1)
    assert [each.key for each in unfitted(state)] == [4, 1]


def test_a_table_says_what_is_known_and_voids_fits_with_something_else(card):
    state = of(card, patient(1, "a", FIT), patient(2, "b", FIT), patient(3, "c"))
    table = (
        Stated(Path("/scans/../scans/a"), (("age", 84.0),)),
        Stated(Path("/scans/b"), ()),
        Stated(Path("/scans/elsewhere"), (("age", 2.0),)),
    )
    new = with_stated(state, table)
    assert known_of(new) == [(("age", 84.0),), (), ()]
    assert [each.fit is None for each in new.patients] == [True, False, True]
    assert new.patient == state.patient


def test_what_is_doubtful_is_not_taken(card):
    state = of(card, patient(1, "a"), patient(2, "b"), patient(3, "c"))
    one, other = Stated(Path("/scans/a"), (("age", 84.0),)), Stated(Path("/scans/a"), (("age", 85.0),))
    assert known_of(with_stated(state, (one, other))) == [(), (), ()]
    assert known_of(with_stated(state, (one, one))) == [(("age", 84.0),), (), ()]
    wrong = Stated(Path("/scans/b"), (("age", 1.0),), "covariate 'sex' is 'X'")
    assert known_of(with_stated(state, (wrong,))) == [(), (), ()]
