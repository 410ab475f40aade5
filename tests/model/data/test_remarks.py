"""What is said about something that came in."""

from __future__ import annotations

import doctest

from naisr_model.data import remarks
from naisr_model.data.remarks import Remark


def test_the_example_in_the_documentation():
    assert doctest.testmod(remarks).failed == 0


def test_a_program_reads_what_was_written():
    written = Remark("look", "edges", "12 open edges", "close the holes").to_json()
    assert list(written.values()) == ["look", "edges", "12 open edges", "close the holes"]
