"""What the documents say of the repository is so: links lead somewhere, names exist, code runs.

Convention: in the ``CHECKED`` documents, what stands in backticks and holds a slash is a path from the root
of the repository, ``path::name`` something that is defined in that file and ``path::Class.name`` in that
class.
"""

from __future__ import annotations

import ast
import doctest
import importlib
import os
import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from naisr_model.cli.commands import app as naisr
from naisr_viewer.app import cli as naisr_viewer

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "resources" / "docs"
PAGES = sorted(DOCS.glob("*.md"))
DOCUMENTS = (*(ROOT / name for name in ("README.md", "CHANGELOG.md", "CONTRIBUTING.md")), *PAGES)
CHECKED = (DOCS / "architecture.md", ROOT / "CONTRIBUTING.md")

FENCE = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\]\(([^)\s]+)\)")
NAME = re.compile(r"`([^`\s]+/[^`\s]*)`")
HTML = re.compile(r"<[a-z/!][^>]*>", re.IGNORECASE)
COMMAND = re.compile(r"^(?:    )?(naisr(?:-viewer)? .*)$", re.MULTILINE)
HEADING = re.compile(r"^#+ (.*)$", re.MULTILINE)


def prose(text: str) -> str:
    """A document without its blocks of code."""
    return FENCE.sub("", text)


def blocks(document: Path, language: str) -> list[str]:
    """The blocks of code in a language."""
    return [code for name, code in FENCE.findall(document.read_text(encoding="utf-8")) if name == language]


def anchors(document: Path) -> set[str]:
    """What a link after ``#`` may name in a document, as GitHub makes it of the headings."""
    headings = HEADING.findall(prose(document.read_text(encoding="utf-8")))
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def broken_links(document: Path) -> Iterator[str]:
    for link in LINK.findall(prose(document.read_text(encoding="utf-8"))):
        place, _, anchor = link.partition("#")
        target = document.parent / place if place else document
        if link.startswith("https://"):
            continue
        if not target.exists() or (anchor and anchor not in anchors(target)):
            yield link


def defined(file: Path, name: str) -> bool:
    """Whether ``name`` or ``Class.name`` is defined at the top of a module or of that class."""
    scope: ast.Module | ast.ClassDef | None = ast.parse(file.read_text(encoding="utf-8"))
    for part in name.split("."):
        if scope is None or part not in (members := names_in(scope)):
            return False
        scope = members[part]
    return True


def names_in(scope: ast.Module | ast.ClassDef) -> dict[str, ast.ClassDef | None]:
    """What a module or a class defines; of classes their own scope."""
    found: dict[str, ast.ClassDef | None] = {}
    for node in scope.body:
        if isinstance(node, ast.ClassDef):
            found[node.name] = node
        elif isinstance(node, ast.FunctionDef):
            found[node.name] = None
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            found |= {target.id: None for target in targets if isinstance(target, ast.Name)}
    return found


def missing_names(document: Path) -> Iterator[str]:
    for name in NAME.findall(prose(document.read_text(encoding="utf-8"))):
        path, _, inside = name.partition("::")
        if not (ROOT / path).exists() or (inside and not defined(ROOT / path, inside)):
            yield name


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda document: document.name)
def test_links_lead_somewhere(document: Path) -> None:
    assert list(broken_links(document)) == []


@pytest.mark.parametrize("document", CHECKED, ids=lambda document: document.name)
def test_names_exist(document: Path) -> None:
    assert list(missing_names(document)) == []


def test_what_is_missing_is_found(tmp_path: Path) -> None:
    document = tmp_path / "page.md"
    document.write_text(
        "# A page\n[a](nowhere.md) [b](#a-page) [c](#another)\n"
        "`naisr_model/nothing.py` `naisr_model/frames.py::Frame.to_mm` `naisr_model/frames.py::Frame.to_cm` "
        "`naisr_model/files.py::replacing` `naisr_model/files.py::nothing`\n```sh\nls a/b [d](d.md)\n```\n"
    )
    assert list(broken_links(document)) == ["nowhere.md", "#another"]
    assert list(missing_names(document)) == [
        "naisr_model/nothing.py",
        "naisr_model/frames.py::Frame.to_cm",
        "naisr_model/files.py::nothing",
    ]


def test_every_document_is_in_the_index() -> None:
    links = set(LINK.findall((DOCS / "index.md").read_text(encoding="utf-8")))
    assert {page.name for page in PAGES} - {"index.md"} <= links


def test_every_example_is_named_in_a_document() -> None:
    text = "".join(document.read_text(encoding="utf-8") for document in DOCUMENTS)
    assert [file.name for file in (ROOT / "resources/examples").glob("*.py") if file.name not in text] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_the_program_can_show_every_page(page: Path) -> None:
    """Qt's Markdown: a heading first, and no HTML in the text."""
    text = page.read_text(encoding="utf-8")
    assert text.startswith("# ")
    assert HTML.findall(re.sub(r"`[^`]*`", "", prose(text))) == []


def commands() -> list[str]:
    """Every command of ours that stands in a document as one to type."""
    texts = (document.read_text(encoding="utf-8") for document in DOCUMENTS)
    return sorted({line for text in texts for line in COMMAND.findall(text)})


@pytest.mark.parametrize("command", commands())
def test_commands_are_understood(command: str) -> None:
    """By the parser alone, without being carried out: a wrong name or option raises."""
    program, *words = shlex.split(command, comments=True)
    understands = {"naisr": naisr, "naisr-viewer": naisr_viewer}[program]
    understands.parse_args(words, exit_on_error=False, print_error=False)


def test_the_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 120


def test_python_in_the_readme_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    found: dict[str, Any] = {}
    for code in blocks(ROOT / "README.md", "python"):
        exec(compile(code, "README.md", "exec"), found)
    boy, older, fit = found["boy"], found["older"], found["fit"]
    assert boy.volume > 0 and older.volume > 0
    assert found["distance_mm"].shape == (1,)
    low, high = fit.intervals["weight"]
    assert low <= 34 <= high


def test_sessions_in_modules_run() -> None:
    files = [file for package in ("naisr_model", "naisr_viewer") for file in (ROOT / package).rglob("*.py")]
    names = [
        ".".join(file.relative_to(ROOT).with_suffix("").parts)
        for file in files
        if ">>>" in file.read_text(encoding="utf-8")
    ]
    results = [doctest.testmod(importlib.import_module(name)) for name in names]
    assert sum(result.failed for result in results) == 0
    assert len(results) > 2 and all(result.attempted for result in results)


def test_sessions_in_documents_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    results = [doctest.testfile(os.fspath(page), module_relative=False) for page in DOCUMENTS]
    assert sum(result.failed for result in results) == 0
    assert sum(result.attempted for result in results) > 0
