"""Where the counts of a whole run go."""

from __future__ import annotations

from pathlib import Path

import pytest
from corpus.counts import Counts, with_table
from corpus.kinds import CASES

COUNTS = pytest.StashKey[Counts]()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--counts",
        type=Path,
        metavar="DOCUMENT",
        help="a document to count in how all cases ended",
    )


def pytest_configure(config: pytest.Config) -> None:
    config.stash[COUNTS] = Counts()


def pytest_sessionfinish(session: pytest.Session) -> None:
    document = session.config.getoption("--counts", None)
    counts = session.config.stash[COUNTS]
    if document is not None and counts.ended.total() == len(CASES):
        table = counts.markdown()
        document.write_text(with_table(document.read_text(encoding="utf-8"), table), encoding="utf-8")


@pytest.fixture
def counts(request: pytest.FixtureRequest) -> Counts:
    return request.config.stash[COUNTS]
