"""Broken input of every kind: success with the right volume or one sentence, and nothing else, ever."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator, Mapping
from concurrent.futures import Future
from pathlib import Path

import pytest

from corpus import goods as good_inputs
from corpus import kinds
from corpus.case import Case
from corpus.runner import Outcome, Runner, forget
from corpus.verdict import faults


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
@pytest.mark.parametrize("case", kinds.CASES, ids=lambda case: case.id)
def test_a_broken_input(case: Case, outcomes: Mapping[str, Future[Outcome]]) -> None:
    outcome = outcomes[case.id].result()
    if found := faults(outcome):
        recipe = f"in {outcome.folder}: naisr {' '.join(case.words)}"
        pytest.fail("\n".join([*found, recipe]), pytrace=False)
    forget(outcome)


def test_every_case_has_a_name_of_its_own() -> None:
    assert [name for name, count in Counter(case.id for case in kinds.CASES).items() if count > 1] == []
    assert len(kinds.CASES) >= 500
