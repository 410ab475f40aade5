"""Whether a case ended as it has to: the rules that hold for every command and every input."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from corpus.case import OUT
from corpus.child import Report
from corpus.counts import Ended
from corpus.runner import MOST_MB, Outcome

OURS = re.compile(r"naisr(-viewer)?: |rejected |warning |row \d+|  |- ")
"""How a line begins that the program itself says."""

BAR = re.compile(r"^[a-z]+( [a-z0-9]+)?(: .*(\d+ %|points/s)| .*[━╸╺])")
"""How far the work is, on a terminal and elsewhere."""

PYTHON = re.compile(
    r"Traceback|NoneType|object has no attribute|index out of range|out of bounds for axis|not enough values"
    r"|could not broadcast|too many values|unexpected keyword|'[a-z-]+' codec can't|invalid literal"
    r"|could not convert string|buffer is smaller|unpack requires|cannot reshape|KeyError|TypeError"
    r"|ValueError|0x[0-9a-f]{8,}|must be str|expected str instance|\b(int|float|str)\(\)"
)
"""What no sentence for people holds."""

LONGEST = 1500
"""Letters of a refusal; whoever has to read more does not."""


def faults(outcome: Outcome) -> list[str]:
    """What is wrong with how a case ended; empty where nothing is."""
    report = outcome.report
    if report is None:
        return [f"the process {outcome.death}: {_last_words(outcome.err)}"]
    if report.code is None:
        return [f"an exception came out: {report.trace[-1500:]}"]
    return [*_of_any(outcome, report), *(_of_success if report.code == 0 else _of_refusal)(outcome, report)]


def ended(outcome: Outcome, found: Sequence[str]) -> Ended:
    """How a case is counted."""
    if found or outcome.report is None:
        return "failed"
    return "refused" if outcome.report.code else "success"


def _of_any(outcome: Outcome, report: Report) -> Iterator[str]:
    if report.peak_mb > MOST_MB:
        yield f"held {report.peak_mb:.0f} MB"
    if outcome.scratch:
        yield f"left temporary files: {outcome.scratch}"
    if hidden := [name for name in _new(outcome) if "/." in f"/{name}" or name.endswith((".tmp", ".lock"))]:
        yield f"left half a file: {hidden}"
    if strange := [line for line in report.err.splitlines() if line.strip() and not _is_ours(line)]:
        yield f"says on standard error what is not its own: {strange[:3]}"


def _of_success(outcome: Outcome, report: Report) -> Iterator[str]:
    expected = outcome.case.expected
    if expected.ending == "refused":
        yield f"was accepted: {(report.out + report.err)[-600:]}"
    if wrong := _wrong(outcome):
        yield f"{wrong}; it said: {(report.out + report.err)[-600:]}"
    if not re.search(expected.says, report.out + report.err):
        yield f"said nothing of '{expected.says}': {(report.out + report.err)[-600:]}"
    if changed := [name for name in _changed(outcome) if not _is_output(name)]:
        yield f"changed its input: {changed}"


def _wrong(outcome: Outcome) -> str:
    """What is wrong with the results."""
    try:
        return outcome.case.expected.check(outcome.folder)
    except (OSError, ValueError, LookupError, AttributeError, TypeError) as error:
        return f"the results cannot be read ({error!r})"


def _last_words(err: str) -> str:
    """Where a process was when it died, if it could say so."""
    fatal, thread = err.find("Fatal Python error"), err.find("Current thread")
    return err[fatal : fatal + 60] + err[thread : thread + 2000] if fatal >= 0 else err[-1500:]


def _of_refusal(outcome: Outcome, report: Report) -> Iterator[str]:
    if outcome.case.expected.ending == "success":
        yield f"was refused: {report.err[-600:]}"
    if report.code != 2:
        yield f"exit code {report.code}"
    if not re.search(r"^naisr(-viewer)?: \S.{10,}", report.err, re.MULTILINE):
        yield f"no sentence: '{report.err[-300:]}'"
    if found := PYTHON.search(report.err):
        yield f"speaks Python ('{found[0]}'): {report.err[-600:]}"
    if len(report.err) > LONGEST:
        yield f"needs {len(report.err)} letters: {report.err[:300]} ..."
    if new := _new(outcome):
        yield f"left files behind: {new}"
    if changed := _changed(outcome):
        yield f"changed what was there: {changed}"


def _is_ours(line: str) -> bool:
    return bool(OURS.match(line) or BAR.match(line))


def _is_output(name: str) -> bool:
    """A training writes beside what it goes on from."""
    return name.startswith((f"{OUT}/", "mine."))


def _new(outcome: Outcome) -> list[str]:
    return sorted(set(outcome.after) - set(outcome.before))


def _changed(outcome: Outcome) -> list[str]:
    return [name for name, content in outcome.before.items() if outcome.after.get(name) != content]
