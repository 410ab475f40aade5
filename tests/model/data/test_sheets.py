"""One small table in every dress that people's tools put on it, and files that are no tables."""

from __future__ import annotations

import datetime
import gzip
import io

import numpy as np
import openpyxl
import pytest

from naisr_model.data.patients import read_points
from naisr_model.data.sheets import read_sheet
from naisr_model.data.tables import read_table
from naisr_model.errors import InputError

COMMAS = "mesh,subject,age [months],sex\na.stl,p1,12.5,F\nb.stl,p2,24,M\nc.stl,p3,110,M\nd.stl,p4,57.25,F\n"
SEMICOLONS = COMMAS.replace(",", ";").replace("12.5", "12,5").replace("57.25", "57,25")
LINES = COMMAS.splitlines()
VALUES = [[12.5, -1], [24, 1], [110, 1], [57.25, -1]]


def workbook(rows) -> bytes:
    book, data = openpyxl.Workbook(), io.BytesIO()
    for row in rows:
        book.active.append(row)
    book.save(data)
    return data.getvalue()


def as_numbers(text: str):
    rows = [line.split(",") for line in text.splitlines()]
    return [[float(cell) if cell.replace(".", "").isdigit() else cell for cell in row] for row in rows]


DRESSES: dict[str, str | bytes] = {
    "commas": COMMAS,
    "semicolons and decimal commas": SEMICOLONS,
    "Excel's line": "sep=;\n" + SEMICOLONS,
    "Excel's line for commas": ("sep=,\n" + COMMAS).replace("\n", "\r\n"),
    "tabs": COMMAS.replace(",", "\t"),
    "tabs and decimal commas": SEMICOLONS.replace(";", "\t"),
    "bars": COMMAS.replace(",", "|"),
    "spaces": COMMAS.replace(" [months]", "").replace(",", "   "),
    "byte order mark": b"\xef\xbb\xbf" + COMMAS.encode(),
    "UTF-16": SEMICOLONS.encode("utf-16"),
    "UTF-16 without its mark": COMMAS.encode("utf-16-le"),
    "UTF-16, the other way round": COMMAS.encode("utf-16-be"),
    "UTF-32": COMMAS.encode("utf-32"),
    "old Macintosh": COMMAS.replace("\n", "\r"),
    "Windows": COMMAS.replace("\n", "\r\n"),
    "empty columns at the end": COMMAS.replace("\n", ",,\n"),
    "empty columns at the end of rows alone": COMMAS.replace("F\n", "F,,\n").replace("M\n", "M,,\n"),
    "quotes": COMMAS.replace("a.stl", '"a.stl"').replace("12.5", '"12,5"'),
    "quotes and spaces": COMMAS.replace("a.stl", '"a.stl" ').replace(",p2", ', "p2"'),
    "other case": COMMAS.replace("mesh,subject", "Mesh, SUBJECT "),
    "a header over two lines": COMMAS.replace("age [months]", '"age\n[months]"'),
    "a running number": "\n".join(f"{i - 1 if i else ''},{row}" for i, row in enumerate(LINES)),
    "blank lines": "\n\n" + COMMAS.replace("\n", "\n\n") + ",,,\n",
    "Excel": workbook(as_numbers(COMMAS)),
    "spellings": COMMAS.replace("24,M", "24,male").replace("57.25,F", "57.25,f"),
}


@pytest.mark.parametrize("dress", DRESSES)
def test_a_table_is_read_in_every_dress(tmp_path, dress):
    content = DRESSES[dress]
    path = tmp_path / "data.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    table = read_table(path)
    np.testing.assert_array_equal(table.values, VALUES)
    assert [row.subject for row in table.rows] == ["p1", "p2", "p3", "p4"]
    assert [row.mesh.name for row in table.rows] == ["a.stl", "b.stl", "c.stl", "d.stl"]
    assert table.covariates[1].levels == ("F", "M")


def test_rows_are_numbered_as_a_spreadsheet_shows_them(tmp_path):
    (tmp_path / "data.csv").write_text("sep=;\n\n" + SEMICOLONS)
    assert [line.number for line in read_sheet(tmp_path / "data.csv").lines] == [4, 5, 6, 7]


def test_accents_of_windows_are_read_and_told(tmp_path):
    (tmp_path / "data.csv").write_bytes(COMMAS.replace("p1", "Müller").encode("latin-1"))
    table = read_table(tmp_path / "data.csv")
    assert table.rows[0].subject == "Müller"
    assert "Windows-1252" in table.remarks[0].text


def test_the_sheet_that_was_read_is_told(tmp_path):
    book, data = openpyxl.Workbook(), io.BytesIO()
    for row in as_numbers(COMMAS):
        book.active.append(row)
    book.create_sheet("Codebook")["A1"] = "age: in months"
    book.save(data)
    (tmp_path / "data.xlsx").write_bytes(data.getvalue())
    table = read_table(tmp_path / "data.xlsx")
    assert "2 sheets" in table.remarks[0].text
    np.testing.assert_array_equal(table.values, VALUES)


def test_what_excel_made_of_a_cell_is_told(tmp_path):
    rows = as_numbers(COMMAS)
    rows[1][2], rows[2][3] = datetime.date(2020, 1, 2), "#N/A"
    (tmp_path / "data.xlsx").write_bytes(workbook(rows))
    with pytest.raises(InputError) as caught:
        read_table(tmp_path / "data.xlsx")
    assert "in row 2, a date" in str(caught.value)
    assert "'#N/A' in row 3" in str(caught.value)


NO_TABLES: dict[str, tuple[bytes, str]] = {
    "a web page": (b"<!DOCTYPE html><html>", "web page"),
    "compressed": (gzip.compress(COMMAS.encode()), "unpack"),
    "an old workbook": (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(500), "save it as .xlsx"),
    "half a workbook": (workbook(as_numbers(COMMAS))[:2000], "save it as .xlsx"),
    "another archive": (b"PK\x03\x04" + bytes(100), "save it as .xlsx"),
    "a picture": (b"\x89PNG\r\n\x1a\n" + bytes(range(256)), "no text"),
    "nothing": (b"", "no column 'subject'"),
    "a quote without its partner": (COMMAS.replace("a.stl", '"a.stl').encode(), "quote without its partner"),
    "an unquoted decimal comma": (
        COMMAS.replace("12.5", "12,5").encode(),
        "row 2 has 5 cells, the header has",
    ),
    "rows of all lengths": (COMMAS.replace("24,M", "24").replace("F\n", "F,1\n").encode(), "rows 3 and 5"),
}


@pytest.mark.parametrize("name", NO_TABLES)
def test_what_is_no_table_is_told_in_a_sentence(tmp_path, name):
    content, words = NO_TABLES[name]
    (tmp_path / "data.csv").write_bytes(content)
    with pytest.raises(InputError) as caught:
        read_table(tmp_path / "data.csv")
    assert words in str(caught.value)
    assert "data.csv" in str(caught.value)


def test_a_folder_in_the_place_of_a_table_is_told(tmp_path):
    with pytest.raises(InputError, match="is a folder"):
        read_table(tmp_path)


@pytest.mark.parametrize(
    "text",
    [
        "1.5;2.5;3.5\n4;5;6\n",
        "1,5;2,5;3,5\n4;5;6\n",
        "X [mm];Y [mm];Z [mm]\n1,5;2,5;3,5\n4;5;6\n",
        "sep=;\nx;y;z\n1,5;2,5;3,5\n4;5;6\n",
        "# made by hand\n1.5\t2.5\t3.5\n\n4\t5\t6\n",
        "name,x,y,z\na,1.5,2.5,3.5\nb,4,5,6\n",
        "  1.5   2.5 3.5\n4 5 6\n",
    ],
)
def test_points_are_read_by_the_same_reader(tmp_path, text):
    for encoding in ("utf-8", "utf-8-sig", "utf-16"):
        (tmp_path / "points.csv").write_bytes(text.encode(encoding))
        np.testing.assert_array_equal(read_points(tmp_path / "points.csv"), [[1.5, 2.5, 3.5], [4, 5, 6]])


def test_points_that_may_mean_two_things_are_refused(tmp_path):
    for text in ("1,234;2,345;3,456\n", "1 2 3\n1_0 2 3\n"):
        (tmp_path / "points.csv").write_text(text)
        with pytest.raises(InputError, match="three numbers"):
            read_points(tmp_path / "points.csv")


@pytest.mark.parametrize("count", [501, 200_000])
def test_a_cell_that_is_a_text_is_told_in_a_short_sentence(tmp_path, count):
    path = tmp_path / "t.csv"
    path.write_text(f"subject,age\na,{'M' * count}\nb,5\n")
    with pytest.raises(InputError, match=rf"t\.csv row 2 has a cell of {count:,} letters") as error:
        read_sheet(path)
    assert len(str(error.value)) < 200
