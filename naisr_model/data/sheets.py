"""Tables as people's tools write them, as rows of text: CSV of every kind, and Excel's .xlsx.

What a file is tells its content, not its name: commas, semicolons, tabs, ``|`` or spaces between cells,
``sep=;`` before the header, UTF-8, UTF-16 or Windows-1252, a byte order mark, quotes, columns at the end
that hold nothing.
"""

from __future__ import annotations

import csv
import io
import itertools
import math
import os
import re
import warnings
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from naisr_model.data import formats
from naisr_model.data.remarks import Remark
from naisr_model.errors import InputError

SEPARATORS = ("\t", ";", "|", ",")
"""What parts cells, the rarer in texts first: where several fit equally well, the first is taken."""

TELLING_LINES = 1000
"""How much of a text says what parts its cells."""

LARGEST_BYTES = 200_000_000
"""A table of a million rows is smaller."""

LONGEST_CELL = 500
"""Letters; a path is shorter, and what is longer is text that a quote without its partner holds together."""

# Python's reader gives up by itself beyond 131,072 letters, which is judged here.
csv.field_size_limit(LARGEST_BYTES)

_MARKS = {
    b"\xef\xbb\xbf": "utf-8-sig",
    b"\xff\xfe\x00\x00": "utf-32",
    b"\x00\x00\xfe\xff": "utf-32",
    b"\xff\xfe": "utf-16",
    b"\xfe\xff": "utf-16",
}
"""Byte order marks and what they announce; of those that begin alike the longer one first."""

_FOREIGN = {
    b"\xd0\xcf\x11\xe0": "an old or protected Excel file; save it as .xlsx or CSV",
    b"\x1f\x8b": "compressed; unpack it first",
    b"%PDF": "a PDF; export the table as CSV",
    b"{\\rtf": "a text document; export the table as CSV",
    b"<": "a web page or XML; export the table as CSV",
}
"""Beginnings of files that are no tables, and what they are."""


_TITLE = re.compile(r"^(?P<name>.*?)\s*(?:\[(?P<square>[^\]]*)\]|\((?P<round>[^)]*)\))?\s*$")


class Line(NamedTuple):
    """One row of cells; ``number`` is its line as a spreadsheet or an editor shows it, from 1."""

    number: int
    cells: tuple[str, ...]


@dataclass(frozen=True)
class Sheet:
    """A table with a header, as text.

    Attributes:
        name: of the file, for messages.
        titles: the header; none is empty, and no two are the same.
        lines: as many cells a line as there are titles.
        remarks: what was odd about the file.
    """

    name: str
    titles: tuple[str, ...]
    lines: tuple[Line, ...]
    remarks: tuple[Remark, ...]

    def column(self, title: str) -> tuple[str, ...]:
        """The cells under a title."""
        place = self.titles.index(title)
        return tuple(line.cells[place] for line in self.lines)

    def records(self) -> list[dict[str, str]]:
        """Each line as cells by title."""
        return [dict(zip(self.titles, line.cells, strict=True)) for line in self.lines]


def read_sheet(path: str | Path) -> Sheet:
    """Read a table whose first line that is not blank is its header.

    Columns without any text are left out, and so is a running number without a title at the start. An
    empty file has no titles.

    Raises:
        InputError: when the file is no table, has a column without a name or one twice, or lines that
            have other cells than the header.
    """
    name = Path(path).name
    lines, remarks = read_lines(path)
    if not lines:
        return Sheet(name, (), (), remarks)
    (_, header), *rows = lines
    titles = tuple(" ".join(title.split()) for title in header)
    rows = [Line(number, _fitted(cells, len(titles))) for number, cells in rows]
    _same_width(name, titles, rows)
    kept = [i for i in range(len(titles)) if titles[i] or any(row.cells[i] for row in rows)]
    if kept and not titles[kept[0]] and _counts_up([row.cells[kept[0]] for row in rows]):
        kept = kept[1:]
    names = tuple(titles[i] for i in kept)
    if "" in names:
        raise InputError(f"{name} has a column without a name; name it or remove it")
    if doubled := [title for title, count in Counter(names).items() if count > 1]:
        raise InputError(f"{name} has the column '{doubled[0]}' twice; rename one")
    return Sheet(name, names, tuple(Line(n, tuple(cells[i] for i in kept)) for n, cells in rows), remarks)


def split_title(title: str) -> tuple[str, str]:
    """Name and unit: ``age [months]`` to ``("age", "months")``."""
    match = _TITLE.match(title.strip())
    if match is None:
        return title.strip(), ""
    return match["name"], (match["square"] or match["round"] or "").strip()


def _fitted(cells: tuple[str, ...], width: int) -> tuple[str, ...]:
    """Without the empty cells beyond the header."""
    return cells if any(cells[width:]) else cells[:width]


def _same_width(name: str, titles: Sequence[str], rows: Sequence[Line]) -> None:
    wrong = [row for row in rows if len(row.cells) != len(titles)]
    if not wrong:
        return
    first, others = wrong[0], numbered([row.number for row in wrong[1:]])
    fits = f"; nor do{'es' * (len(wrong) == 2)} {others} fit" if others else ""
    raise InputError(
        f"{name} row {first.number} has {len(first.cells)} cells, the header has {len(titles)}{fits}; put "
        f"what holds a comma in quotes, or part the cells by semicolons"
    )


def numbered(rows: Sequence[int]) -> str:
    """Line numbers for people, neighbours as ranges: ``row 3``, ``rows 2, 5-9 and 12``; at most ten."""
    ranges: list[list[int]] = []
    for row in sorted(set(rows)):
        if ranges and row == ranges[-1][1] + 1:
            ranges[-1][1] = row
        else:
            ranges.append([row, row])
    words = [str(start) if start == end else f"{start}-{end}" for start, end in ranges]
    if more := sum(end - start + 1 for start, end in ranges[10:]):
        words = [*words[:10], f"{more} more"]
    listed = " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
    return f"{'row' if len(set(rows)) == 1 else 'rows'} {listed}" if listed else ""


def _counts_up(cells: Sequence[str]) -> bool:
    """The running number that pandas and R put before each row."""
    return any(list(cells) == [str(i + start) for i in range(len(cells))] for start in (0, 1))


def read_lines(path: str | Path, comment: str = "") -> tuple[list[Line], tuple[Remark, ...]]:
    """Every line that holds something, as stripped cells, and what was odd about the file.

    Args:
        path: of the file.
        comment: lines of a text that begin so are left out; empty to read all.

    Raises:
        InputError: when there is no such file, or it is no table.
    """
    path = Path(path)
    data = _bytes(path)
    if data[:4] == b"PK\x03\x04":
        lines, remarks = _workbook(path, data)
    else:
        text, remarks = decoded(path, data)
        lines = _delimited(path, text, comment)
    stripped = (Line(number, tuple(cell.strip() for cell in cells)) for number, cells in lines)
    filled = [line for line in stripped if any(line.cells)]
    for line in filled:
        _require_short(path.name, line)
    return filled, remarks


def _require_short(name: str, line: Line) -> None:
    longest = max(line.cells, key=len)
    if len(longest) > LONGEST_CELL:
        raise InputError(
            f"{name} row {line.number} has a cell of {len(longest):,} letters that begins with "
            f"'{' '.join(longest[:30].split())}'; shorten it, or look for a quote without its partner"
        )


def read_text(path: str | Path) -> tuple[str, tuple[Remark, ...]]:
    """A text file in whatever encoding, and what was odd about it.

    Raises:
        InputError: when there is no such file, or it is no text.
    """
    return decoded(Path(path), _bytes(Path(path)))


def _bytes(path: Path) -> bytes:
    if os.path.isfile(path) and not os.path.getsize(path):
        return b""
    content = formats.content_of(path)
    if len(content) > LARGEST_BYTES:
        raise InputError(
            f"{path.name} has over {LARGEST_BYTES // 10**6} MB and is no table; correct the path"
        )
    return content


def decoded(path: Path, data: bytes) -> tuple[str, tuple[Remark, ...]]:
    """The text of a file's bytes: by its byte order mark, as UTF-8, or else as Windows-1252 with a remark.

    Raises:
        InputError: when it is no text.
    """
    for start, what in _FOREIGN.items():
        if data.lstrip()[: len(start)] == start:
            raise InputError(f"{path.name} is {what}")
    encoding = next((code for mark, code in _MARKS.items() if data.startswith(mark)), _guessed(data))
    try:
        text = _without_nul(path, data, data.decode(encoding))
        if len(data) < 4 or any(mark.isascii() for mark in text[1:]):  # as every table of ours has
            return text, ()
    except UnicodeDecodeError as error:
        if encoding != "utf-8":
            raise _garbled(path) from error
    if encoding != "utf-8":
        raise _garbled(path)
    text = _without_nul(path, data, data.decode("cp1252", errors="replace"))
    sentence = "the text is not UTF-8 and was read as Windows-1252 (Western Europe)"
    return text, (Remark("fine", "encoding", sentence, "look at names with accents, or save it as UTF-8"),)


def _garbled(path: Path) -> InputError:
    return InputError(f"{path.name} is damaged text; export it again as UTF-8")


def _guessed(data: bytes) -> str:
    """UTF-16 without its mark shows in the zeros beside Latin letters."""
    start = data[:400]
    if start and start[1::2].count(0) > 0.4 * len(start):
        return "utf-16-le"
    if start and start[0::2].count(0) > 0.4 * len(start):
        return "utf-16-be"
    return "utf-8"


def _without_nul(path: Path, data: bytes, text: str) -> str:
    if "\x00" in text:
        what = "is an atlas or another .safetensors file and" if formats.is_tensors(data) else "is"
        raise InputError(f"{path.name} {what} no text; give a table as CSV or .xlsx")
    return text


# --- text --------------------------------------------------------------------------------------


def _delimited(path: Path, text: str, comment: str) -> list[Line]:
    separator, text = _announced(text)
    if comment:
        text = "\n".join("" if line.lstrip().startswith(comment) else line for line in text.splitlines())
    separator = separator or _separator(text)
    if separator == " ":
        text = "\n".join(" ".join(line.split()) for line in text.splitlines())
    try:
        lines = _parsed(text, separator, strict=False)
        if not any("\n" in cell or "\r" in cell for line in lines for cell in line.cells):
            return lines
        return _parsed(text, separator, strict=True)  # a cell over several lines, or a stray quote
    except csv.Error as error:
        raise InputError(
            f"{path.name} cannot be read as a CSV table ({error}); look for a quote without its partner"
        ) from error


def _announced(text: str) -> tuple[str, str]:
    """The separator of a first line ``sep=;``, which Excel writes, and the text with that line blank."""
    first, end, rest = text.partition("\n")
    named = first.strip().strip('"')
    if named.lower().startswith("sep=") and len(named) <= len("sep=;"):
        return (named[4:] or "\t"), f"{end}{rest}"
    return "", text


def _separator(text: str) -> str:
    """What parts the cells of the header and of as many lines as possible; spaces if nothing else."""
    start = "".join(itertools.islice(io.StringIO(text, newline=""), TELLING_LINES))
    fits = {one: _fit(_parsed(start, one, strict=False)) for one in SEPARATORS if one in start}
    best = max(fits, key=lambda one: fits[one], default="")
    return best if fits.get(best) else " "


def _parsed(text: str, separator: str, *, strict: bool) -> list[Line]:
    """Cells by Python's own reader; within quotes a cell may go over several lines."""
    reader = csv.reader(
        io.StringIO(text, newline=""), delimiter=separator, skipinitialspace=True, strict=strict
    )
    return [Line(reader.line_num, tuple(cells)) for cells in reader if any(cell.strip() for cell in cells)]


def _fit(lines: Sequence[Line]) -> float:
    """The share of lines that have as many cells as the header; 0 where that is one."""
    widths = [len(_without_end(line.cells)) for line in lines]
    if not widths or widths[0] < 2:
        return 0.0
    wide = len(lines[0].cells)
    return sum(
        len(line.cells) >= widths[0] and w <= wide for line, w in zip(lines, widths, strict=True)
    ) / len(lines)


def _without_end(cells: Sequence[str]) -> Sequence[str]:
    """Cells up to the last that holds something."""
    while cells and not cells[-1].strip():
        cells = cells[:-1]
    return cells


# --- Excel -------------------------------------------------------------------------------------


def _workbook(path: Path, data: bytes) -> tuple[list[Line], tuple[Remark, ...]]:
    """The first sheet that holds something, the values of formulas as Excel last computed them."""
    from openpyxl import load_workbook  # takes a third of a second, and few tables need it

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            book = load_workbook(io.BytesIO(data), read_only=True, data_only=True)
            sheets = [(sheet.title, _cells(sheet)) for sheet in book.worksheets]
    except Exception as error:  # the reader raises whatever it likes on damaged and foreign files
        raise InputError(
            f"{path.name} is no Excel table that can be read; save it as .xlsx or CSV again"
        ) from error
    filled = [(title, lines) for title, lines in sheets if lines]
    if len(filled) < 2:
        return (filled[0][1] if filled else []), ()
    sentence = f"the workbook has {len(filled)} sheets, and '{filled[0][0]}' was read"
    return filled[0][1], (Remark("look", "sheets", sentence, "put the sheet that counts first"),)


def _cells(sheet: Any) -> list[Line]:
    sheet.reset_dimensions()  # files of other programs state wrong ones
    rows = sheet.iter_rows(values_only=True)
    lines = [Line(n, tuple(map(_as_text, cells))) for n, cells in enumerate(rows, start=1)]
    filled = [line for line in lines if any(line.cells)]
    width = max((len(_without_end(line.cells)) for line in filled[:1]), default=0)
    return [Line(n, (cells + ("",) * width)[: max(width, len(_without_end(cells)))]) for n, cells in filled]


def _as_text(value: object) -> str:
    """A cell as it reads: numbers that Excel holds as 12.0 without the decimals."""
    if value is None:
        return ""
    if isinstance(value, float) and math.isfinite(value) and value == int(value) and abs(value) < 1e15:
        return str(int(value))
    return str(value)
