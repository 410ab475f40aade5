"""Broken input of every kind: success with the right volume or one sentence, and nothing else, ever."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator, Mapping
from concurrent.futures import Future
from pathlib import Path

import pytest
from corpus import goods as good_inputs
from corpus.case import Case, Special
from corpus.counts import Counts, with_table
from corpus.kinds import CASES, TITLES
from corpus.runner import Outcome, Runner, forget
from corpus.verdict import ended, faults


@pytest.fixture(scope="session")
def outcomes(
    request: pytest.FixtureRequest, egg_atlas: Path, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Mapping[str, Future[Outcome]]]:
    """What becomes of the cases that were chosen; they run on all cores while the tests wait for them."""
    items = [item for item in request.session.items if isinstance(item, pytest.Function)]
    cases = [item.callspec.params["case"] for item in items if item.get_closest_marker("fuzz")]
    goods = good_inputs.made(egg_atlas, tmp_path_factory.mktemp("goods"))
    runner = Runner(goods, tmp_path_factory.mktemp("corpus"), os.cpu_count() or 1)
    yield runner.start(cases)
    runner.close()


@pytest.mark.fuzz
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.id)
def test_a_broken_input(case: Case, outcomes: Mapping[str, Future[Outcome]], counts: Counts) -> None:
    outcome = outcomes[case.id].result()
    found = faults(outcome)
    counts.ended[case.kind, ended(outcome, found)] += 1
    if found:
        recipe = f"in {outcome.folder}: naisr {' '.join(case.words)}"
        pytest.fail("\n".join([*found, recipe]), pytrace=False)
    forget(outcome)


def test_every_case_has_a_name_of_its_own_and_a_kind() -> None:
    assert [name for name, count in Counter(case.id for case in CASES).items() if count > 1] == []
    assert {case.kind for case in CASES} == set(TITLES)
    assert len(CASES) >= 500


def test_the_same_seed_makes_the_same_files() -> None:
    made = [case for case in CASES if case.kind in ("mesh", "volume", "cloud")][::25]
    for case in made:
        first, again = (case.files(None) for _ in range(2))
        assert first == again and all(isinstance(each, bytes | Special) for each in first.values())


def test_counts_take_the_place_of_older_ones_below_their_command() -> None:
    counts = Counts()
    counts.ended.update({("mesh", "success"): 1200, ("mesh", "refused"): 30, ("window", "failed"): 1})
    old = "| a | b |\n| --- | --- |\n| 1 | 2 |\n"
    text = f"{old}\n    make fuzz\n\nSome words:\n\n{old}\nMore words.\n"
    changed = with_table(text, counts.markdown())
    assert changed.startswith(f"{old}\n    make fuzz\n\nSome words:\n\n| input | cases |")
    assert "| meshes | 1,230 | 1,200 | 30 | 0 |\n" in changed and changed.endswith("\n\nMore words.\n")
    assert "| together | 1,231 | 1,200 | 30 | 1 |\n" in changed
    with pytest.raises(ValueError, match="no table"):
        with_table("no command", counts.markdown())
