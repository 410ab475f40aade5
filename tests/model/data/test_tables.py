"""The user's table: what is read from it, and what is said when it cannot be."""

from __future__ import annotations

import os

import numpy as np
import pytest

from naisr_model.covariates import Covariate, Population
from naisr_model.data.split import held_out_mask
from naisr_model.data.tables import missing_files, population_from_table, read_table, write_table
from naisr_model.errors import InputError

GOOD = """mesh,subject,visit,age [months],weight (kg),sex,operated
a.ply,p1,first,12,9.5,F,0
b.ply,p1,second,24,12,F,1
c.ply,p2,first,110,30.25,M,0
d.ply,p3,first,200,61,M,0
"""


def table(tmp_path, text, toml=None):
    (tmp_path / "data.csv").write_text(text, encoding="utf-8")
    if toml is not None:
        (tmp_path / "data.toml").write_text(toml, encoding="utf-8")
    return read_table(tmp_path / "data.csv")


def test_names_units_kinds_and_values(tmp_path):
    read = table(tmp_path, GOOD)
    assert [(c.name, c.unit, c.kind) for c in read.covariates] == [
        ("age", "months", "continuous"),
        ("weight", "kg", "continuous"),
        ("sex", "", "binary"),
        ("operated", "", "binary"),
    ]
    assert read.covariates[2].levels == ("F", "M")
    np.testing.assert_array_equal(read.values[0], [12, 9.5, -1, -1])
    np.testing.assert_array_equal(read.values[3], [200, 61, 1, -1])
    assert read.rows[1].mesh == tmp_path / "b.ply"
    assert (read.rows[1].subject, read.rows[1].visit, read.rows[1].number) == ("p1", "second", 3)
    assert (read.name, read.alignment.method, read.source) == ("data", "none", {})


def test_centre_and_scale_come_from_the_training_rows(tmp_path):
    read = table(tmp_path, GOOD)
    held_out = np.array([False, False, False, True])
    population = population_from_table(read, held_out)
    age, _, sex, _ = population.covariates
    training = np.array([12.0, 24.0, 110.0])
    assert age.centre == pytest.approx(training.sum() / 3)
    assert age.scale == pytest.approx(np.sqrt(((training - age.centre) ** 2).sum() / 3))
    assert age.range == (12.0, 110.0)
    assert (sex.centre, sex.scale, sex.range) == (0.0, 1.0, (-1.0, 1.0))
    assert len(population) == 4
    assert population.row(3)["age"] == 200.0


def test_visits_are_numbered_when_the_table_does_not(tmp_path):
    read = table(tmp_path, "subject,age\na,1\nb,2\na,3\n")
    assert [(row.subject, row.visit) for row in read.rows] == [("a", "1"), ("b", "1"), ("a", "2")]


def test_toml_adds_to_the_table(tmp_path):
    toml = """
    name = "my airways"
    [covariates.sex]
    levels = ["M", "F"]
    [covariates.operated]
    kind = "continuous"
    unit = "times"
    [alignment]
    method = "icp"
    [source]
    population = "airway"
    seed = 3
    """
    read = table(tmp_path, GOOD, toml)
    assert read.name == "my airways"
    assert read.covariates[2].levels == ("M", "F")
    assert read.values[0, 2] == 1.0
    assert (read.covariates[3].kind, read.covariates[3].unit) == ("continuous", "times")
    assert read.alignment.method == "icp"
    assert read.source == {"population": "airway", "seed": 3}


def test_landmarks_are_the_default_alignment_where_there_are_any(tmp_path):
    read = table(tmp_path, "subject,landmarks,age\na,l/a.csv,1\nb,,2\nc,l/c.csv,4\n")
    assert read.alignment.method == "landmarks"
    assert [row.landmarks for row in read.rows] == [tmp_path / "l/a.csv", None, tmp_path / "l/c.csv"]


def test_a_byte_order_mark_blank_lines_and_spaces_do_no_harm(tmp_path):
    read = table(tmp_path, "\ufeffsubject, age [months]\n a , 1\n\nb,2 \nc,3\n")
    assert [c.name for c in read.covariates] == ["age"]
    assert [row.number for row in read.rows] == [2, 4, 5]


@pytest.mark.parametrize(
    ("text", "toml", "message"),
    [
        ("mesh,age\na.ply,1\n", None, "no column 'subject'; it has mesh, age"),
        ("", None, "no column 'subject'"),
        ("subject,age\n", None, "no rows"),
        ("subject,mesh\na,a.ply\n", None, "no covariate"),
        ("subject,age,age\na,1,2\n", None, "'age' twice"),
        ("subject,age,\na,1,2\n", None, "without a name"),
        ("subject,age\na,1\nb,2,3\n", None, "row 3 has 3 cells"),
        ("subject,age\na,1\nb,old\nc,3\n", None, "row 3, column 'age' is 'old'; expected a number"),
        ("subject,age\na,1\nb,\nc,3\n", None, "row 3, column 'age' is empty"),
        ("subject,age\na,1\nb,nan\nc,3\n", None, "row 3, column 'age' is 'nan'"),
        ("subject,age\na,1\nb,inf\nc,3\n", None, "row 3, column 'age' is 'inf'"),
        ("subject,age\na,7\nb,7\n", None, "'age' of data.csv is 7 in every row"),
        ("subject,age\na,1\n,2\nc,3\n", None, "row 3, column 'subject' is empty"),
        ("subject,visit,age\na,1,1\nb,1,2\na,1,3\n", None, "rows 2 and 4 are both visit '1' of subject 'a'"),
        ("subject,sex\na,F\nb,M\nc,X\n", None, "'sex' must have two values; it has 3: F, M, X"),
        ("subject,g\na,0\nb,1\nc,2\n", '[covariates.g]\nkind="binary"', "two values; it has 3: 0, 1, 2"),
        ("subject,sex\na,F\nb,M\nc,X\n", '[covariates.sex]\nlevels=["F","M"]', "row 4, column 'sex' is 'X'"),
        ("subject,age [months]\na,1\nb,2\nc,3\n", '[covariates.age]\nunit="years"', "months by the header"),
        ("subject,age\na,1\nb,2\nc,3\n", '[covariates.weight]\nunit="kg"', "'weight', which is not a column"),
        ("subject,age\na,1\nb,2\nc,3\n", '[covariates.age]\nkind="ordinal"', "kind 'ordinal'"),
        ("subject,age\na,1\nb,2\nc,3\n", '[covariates.age]\nunits="y"', "unit, kind and levels only"),
        ("subject,age\na,1\nb,2\nc,3\n", '[alignment]\nmethod="affine"', "alignment method 'affine'"),
        ("subject,age\na,1\nb,2\nc,3\n", '[alignment]\nmethod="landmarks"', "needs a column 'landmarks'"),
        ("subject,age\na,1\nb,2\nc,3\n", "title = 'x'", "has 'title'"),
        ("subject,age\na,1\nb,2\nc,3\n", "[sources]\nseed = 1", "has 'sources'"),
        (
            "subject,age\na,1\nb,2\nc,3\n",
            '[alignment]\nmethd = "icp"',
            "[alignment] in data.toml has 'methd'; it may have method and origin",
        ),
        (
            "subject,age\na,1\nb,2\nc,3\n",
            '[alignment]\nmethod = ["icp"]',
            "'method' in data.toml is ['icp']; put text in quotes",
        ),
        ("subject,age\na,1\nb,2\nc,3\n", "[alignment]\norigin = 3", "'origin' in data.toml is 3"),
        ("subject,age\na,1\nb,2\nc,3\n", "name = 7", "'name' in data.toml is 7"),
        ("subject,age\na,1\nb,2\nc,3\n", "[covariates.age]\nunit = 1", "'unit' in data.toml is 1"),
        (
            "subject,sex\na,F\nb,M\nc,F\n",
            "[covariates.sex]\nlevels = 2",
            "levels of 'sex' in data.toml are 2; give a list of two",
        ),
        (
            "subject,sex\na,F\nb,M\nc,F\n",
            '[covariates.sex]\nlevels = "FM"',
            "levels of 'sex' in data.toml are 'FM'; give a list of two",
        ),
        (
            "subject,sex\na,F\nb,M\nc,F\n",
            '[covariates.sex]\nlevels = ["F"]',
            "must have two values; it has 1: F",
        ),
        (
            "subject,age\na,1\nb,2\nc,3\n",
            "[covariates.age]\nlevels = [1, 2]",
            "row 4, column 'age' is '3'; expected 1 or 2",
        ),
        (
            "subject,age\na,1\nb,2\nc,3\n",
            "[source]\nscanned = 2024-05-01",
            "'scanned' of [source] in data.toml is 2024-05-01",
        ),
        ("subject,age\na,1\nb,2\nc,3\n", "name = ", "not valid TOML"),
        ("subject,age\na,1\nb,2\nc,3\n", "alignment = 'icp'", "must be a table"),
    ],
)
def test_bad_tables_are_explained(tmp_path, text, toml, message):
    with pytest.raises(InputError) as caught:
        table(tmp_path, text, toml)
    assert message in str(caught.value)


def test_a_missing_or_foreign_file_is_explained(tmp_path):
    with pytest.raises(InputError, match=r"gone\.csv does not exist"):
        read_table(tmp_path / "gone.csv")
    (tmp_path / "data.csv").write_bytes(b"\xff\xfe\x00subject")
    with pytest.raises(InputError, match="UTF-8"):
        read_table(tmp_path / "data.csv")


def test_all_cells_that_cannot_be_used_are_told_at_once(tmp_path):
    rows = ["p1,12 months,F", "p2,n/a,M", "p3,1_000,M", "p4,30,", "p5,31,F", "p6,n/a,X", "p7,NA,F", ",40,M"]
    with pytest.raises(InputError) as caught:
        table(tmp_path, "\n".join(["subject,age,sex", *rows]), '[covariates.sex]\nlevels = ["F", "M"]')
    for words in (
        "'subject' is empty in row 9",
        "'12 months' in row 2, a number with a unit; leave the number and write [months]",
        "'n/a' in rows 3 and 7, 'NA' in row 8, which stands for a missing value",
        "'1_000' in row 4",
        "'sex' is empty in row 5",
        "'X' in row 7; expected F or M",
    ):
        assert words in str(caught.value)


def test_hundreds_of_bad_cells_make_one_sentence(tmp_path):
    rows = "".join(f"p{i},{'NA' if i % 2 else i},{i} kg\n" for i in range(400))
    with pytest.raises(InputError) as caught:
        table(tmp_path, "subject,age,weight\n" + rows)
    assert "'NA' in rows 3, 5, 7" in str(caught.value)
    assert "190 more" in str(caught.value)
    assert len(str(caught.value)) < 1000


LOOKS = {
    "-1": ("subject,age\na,-1\nb,24\nc,110\nd,57\n", "'age' is -1 in row 2, and otherwise 24 to 110"),
    "99": ("subject,kg\na,40\nb,99\nc,11\nd,60\n", "'kg' is 99 in row 3, and otherwise 11 to 60"),
    "9": ("subject,grade\na,1\nb,3\nc,9\nd,5\n", "'grade' is 9 in row 4, and otherwise 1 to 5"),
    "categories": ("subject,type\na,1\nb,2\nc,3\nd,1\n", "only the values 1, 2, 3 and was read as a number"),
    "two ages": (
        "subject,age [months]\na,6\nb,24\nc,6.0\n",
        "only the values 6 and 24 and was read as a number",
    ),
    "two numbers": ("subject,age\na,6\nb,24\nc,6.0\n", "only the values 6 and 24 and was read as two levels"),
    "a slip": ("subject,w\na,12\nb,115\nc,13.5\nd,11\ne,14\n", "'w' is 115 in row 3, far from the others"),
    "one subject": ("subject,age\na,6\na,24\na,7\n", "all rows are of one subject"),
}


@pytest.mark.parametrize("name", LOOKS)
def test_what_looks_wrong_is_told(tmp_path, name):
    text, words = LOOKS[name]
    assert any(words in one.text for one in table(tmp_path, text).remarks if one.severity == "look")


CODES = {
    "-99": ("age,-99,24,110,57", "'age' is -99 in row 2, and otherwise 24 to 110", "24 to 110"),
    "999": ("age,24,999,110,999,3", "'age' is 999 in rows 3 and 5, and otherwise 3 to 110", "3 to 110"),
    "-9 and 999": ("w,-9,999,11,15,12", "'w' is -9 in row 2, and otherwise 11 to 15", "11 to 15"),
    "of levels": ("sex,1,2,9,1", "'sex' is 9 in row 4, and otherwise 1 to 2", "1 in 2 rows, 2 in 1 row"),
}


@pytest.mark.parametrize("name", CODES)
def test_what_is_almost_surely_a_code_refuses_its_rows_and_counts_for_nothing(tmp_path, name):
    column, words, told = CODES[name]
    title, *cells = column.split(",")
    text = f"subject,{title}\n" + "".join(f"p{i},{cell}\n" for i, cell in enumerate(cells))
    read = table(tmp_path, text)
    coded = [i for i, cell in enumerate(cells) if cell in ("-99", "999", "-9", "9")]
    assert [i for i, codes in enumerate(read.codes) if codes] == coded
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(read.values[:, 0])), coded)
    assert told in read.told[0]
    assert any(
        words in one.text and "--accept" in one.text for one in read.remarks if one.severity == "refuse"
    )
    assert not any(read.take([i for i in range(len(cells)) if i not in coded]).codes)


def test_a_code_that_is_meant_is_a_value_in_its_row_alone(tmp_path):
    text = "subject,age\na,24\nb,999\nc,110\nd,999\n"
    table(tmp_path, text)
    read = read_table(tmp_path / "data.csv", accepted=[3])
    np.testing.assert_array_equal(read.values[:, 0], [24, 999, 110, np.nan])
    assert [len(codes) for codes in read.codes] == [0, 0, 0, 1]
    assert any("'age' is 999 in row 3" in one.text for one in read.remarks if one.severity == "look")
    with pytest.raises(InputError, match=r"data\.csv has no row 7 to accept; its rows are 2 to 5"):
        read_table(tmp_path / "data.csv", accepted=[3, 7])


def test_levels_of_the_toml_are_no_codes(tmp_path):
    read = table(tmp_path, "subject,x\na,1\nb,99\nc,1\n", "[covariates.x]\nlevels = [1, 99]")
    np.testing.assert_array_equal(read.values[:, 0], [-1, 1, -1])


def test_values_far_from_the_others_are_told_first(tmp_path):
    rows = "".join(f"p{i},{1 + i % 3},{12 + i % 5}\n" for i in range(12))
    read = table(tmp_path, f"subject,grade,w [kg]\n{rows}q,1,115\n")
    assert [remark.topic for remark in read.remarks] == ["outlier", "kind"]


@pytest.mark.parametrize(
    "column",
    [
        "age [months],1,23,55,71,89,111,129,161,179,199,233",
        "age,0,10,20,30,40,50,60,70,80,90,99",
        "weight [kg],3.9,14.2,20.1,21.8,19.7,32.85,44.8,21.3,59.0,93.9,75.6",
        "operated,0,1,1,0,0,1,0,0,0,1,1",
        "sex,F,M,M,F,F,M,F,F,F,M,M",
        "z,-1.2,0.3,-1,1.4,0.2,-0.4,0.9,2.2,-2.1,0.4,0.6",
    ],
)
def test_of_usual_columns_nothing_is_told(tmp_path, column):
    title, *cells = column.split(",")
    rows = "".join(f"p{i},{cell}\n" for i, cell in enumerate(cells))
    assert table(tmp_path, f"subject,{title}\n{rows}").remarks == ()


def test_the_kind_in_the_toml_answers_the_question(tmp_path):
    text = "subject,grade\na,1\nb,2\nc,3\nd,1\n"
    assert table(tmp_path, text, '[covariates.grade]\nkind = "continuous"').remarks == ()
    text = "subject,age [months]\na,6\nb,24\nc,6.0\n"
    read = table(tmp_path, text, '[covariates.age]\nkind = "binary"')
    assert read.covariates[0].levels == ("6", "24")
    np.testing.assert_array_equal(read.values[:, 0], [-1, 1, -1])


@pytest.mark.parametrize(
    ("cells", "levels", "values"),
    [
        ("M m male F f woman", ("F", "M"), [1, 1, 1, -1, -1, -1]),
        ("yes no Y N TRUE False", ("N", "Y"), [1, -1, 1, -1, 1, -1]),
        ("Left left right RIGHT L r", ("L", "r"), [-1, -1, 1, 1, -1, 1]),
        ("shunt Shunt none? none? shunt none?", ("none?", "shunt"), [1, 1, -1, -1, 1, -1]),
        ("+ - + - - +", ("+", "-"), [-1, 1, -1, 1, 1, -1]),
        ("0 1.0 1 0.0 0 1", ("0", "1"), [-1, 1, 1, -1, -1, 1]),
    ],
)
def test_spellings_of_a_level_are_one(tmp_path, cells, levels, values):
    rows = "".join(f"p{i},{cell}\n" for i, cell in enumerate(cells.split()))
    read = table(tmp_path, "subject,level\n" + rows)
    assert read.covariates[0].levels == levels
    np.testing.assert_array_equal(read.values[:, 0], values)
    assert {one.severity for one in read.remarks} <= {"fine"}


def test_levels_of_the_toml_are_found_in_any_spelling(tmp_path):
    read = table(tmp_path, "subject,sex\na,male\nb,f\nc,M\n", '[covariates.sex]\nlevels = ["M", "F"]')
    np.testing.assert_array_equal(read.values[:, 0], [-1, 1, -1])
    read = table(tmp_path, "subject,op\na,none\nb,shunt\n", '[covariates.op]\nlevels = ["none", "shunt"]')
    np.testing.assert_array_equal(read.values[:, 0], [-1, 1])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("subject,age,Age\na,1,2\nb,2,3\n", "both 'age' and 'Age'"),
        ("subject,age\na,1\n", "has one row"),
        ("subject,op\na,none\nb,shunt\nc,shunt\n", 'write levels = ["none", "shunt"] into the TOML'),
        ("subject,sex\na,F\nb,M\nc,F\nd,M\ne,unclear\n", "unclear is in row 6"),
        ("subject,w\na,1.234\nb,12,5\n", "row 3 has 3 cells"),
        ("subject;w\na;1.234\nb;12,5\n", "which may be 1.234 or 1234"),
        ("subject,age\na,1e308\nb,2\n", "larger than anything that is measured"),
    ],
)
def test_what_may_mean_two_things_is_refused(tmp_path, text, words):
    with pytest.raises(InputError) as caught:
        table(tmp_path, text)
    assert words in str(caught.value)


def test_what_was_understood_is_summed_up(tmp_path):
    summary = "\n".join(table(tmp_path, GOOD).summary)
    for words in (
        "4 rows, 3 subjects",
        "age [months]: a number from 12 to 200, median 67",
        "sex: F in 2 rows, M in 2 rows",
        "operated: 0 in 3 rows, 1 in 1 row",
        "TOML",
    ):
        assert words in summary


def test_names_with_marks_are_names(tmp_path):
    names = ['"a,b"', "a=b", "../../evil", "<b>age</b>"]
    read = table(tmp_path, f"subject,{','.join(names)}\np,1,2,3,4\nq,2,3,4,5\nr,4,6,7,8\n")
    assert [covariate.name for covariate in read.covariates] == ["a,b", "a=b", "../../evil", "<b>age</b>"]


def test_files_are_found_however_their_paths_are_written(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    (tmp_path / "home").mkdir()
    (tmp_path / "scans").mkdir()
    here = [tmp_path / "scans" / "p 1.stl", tmp_path / "home" / "p2.stl"]
    for path in here:
        path.write_text("")
    cells = ["scans\\p 1.stl", ".\\scans\\p 1.stl", here[0].as_uri(), "~/p2.stl", str(here[1])]
    rows = "".join(f"{cell},p{i},{i}\n" for i, cell in enumerate(cells))
    read = table(tmp_path, "mesh,subject,age\n" + rows)
    assert [row.mesh.resolve() for row in read.rows] == [here[i] for i in (0, 0, 0, 1, 1)]
    assert missing_files(read) == ()


@pytest.mark.skipif(os.sep != "/", reason="these paths are missing elsewhere only")
def test_files_that_are_missing_are_told_with_what_may_be_meant(tmp_path):
    (tmp_path / "P01.STL").write_text("")
    cells = ["p01.stl", "C:\\scans\\p02.stl", "https://host/p03.stl", "p04.stl", "p" * 300]
    rows = "".join(f"{cell},p{i},{i}\n" for i, cell in enumerate(cells))
    found = missing_files(table(tmp_path, "mesh,subject,age\n" + rows))
    for words, sentence in zip(
        ["'P01.STL'", "Windows", "an address", "correct", "correct"], found, strict=True
    ):
        assert words in sentence


def test_a_covariate_constant_in_training_is_explained(tmp_path):
    read = table(tmp_path, "subject,age\na,1\nb,1\nc,3\n")
    with pytest.raises(InputError, match="'age' does not vary"):
        population_from_table(read, np.array([False, False, True]))


def test_a_population_goes_to_csv_and_back_unchanged(tmp_path):
    rng = np.random.default_rng(0)
    values = np.stack([rng.uniform(1, 230, 9), rng.uniform(3, 90, 9), np.tile([-1.0, 1.0, 1.0], 3)], axis=1)
    subjects = ("a", "a", "a", "b, jr", "b, jr", 'c "x"', "d", "e", "f")
    visits = ("1", "2", "3", "1", "2", "1", "1", "1", "1")
    held_out = held_out_mask(subjects, 0.2, 1)
    covariates = (
        Covariate("age", "months", "continuous", 0.0, 1.0, (0.0, 1.0)),
        Covariate("weight", "kg", "continuous", 0.0, 1.0, (0.0, 1.0)),
        Covariate("sex", "", "binary", 0.0, 1.0, (-1.0, 1.0), ("F", "M")),
    )
    rough = Population(covariates, subjects, visits, values, held_out)
    write_table(rough, tmp_path / "first.csv")
    first = population_from_table(read_table(tmp_path / "first.csv"), held_out)
    write_table(first, tmp_path / "second.csv", meshes=[f"{i}.ply" for i in range(9)])
    second = population_from_table(read_table(tmp_path / "second.csv"), held_out)
    assert (tmp_path / "first.csv").read_text().startswith("subject,visit,age [months],weight [kg],sex\n")
    np.testing.assert_array_equal(first.values, values)
    assert (first.subjects, first.visits) == (subjects, visits)
    assert first.to_json() == second.to_json()


def test_whole_subjects_are_held_out_whatever_the_order():
    subjects = [f"s{i % 40}" for i in range(100)]
    mask = held_out_mask(subjects, 0.2, seed=5)
    chosen = {s for s, out in zip(subjects, mask, strict=True) if out}
    assert len(chosen) == 8
    assert not chosen & {s for s, out in zip(subjects, mask, strict=True) if not out}
    order = np.random.default_rng(0).permutation(100)
    np.testing.assert_array_equal(held_out_mask([subjects[i] for i in order], 0.2, seed=5), mask[order])
    assert not np.array_equal(held_out_mask(subjects, 0.2, seed=6), mask)
    assert not held_out_mask(subjects, 0.0).any()
    assert held_out_mask(["only"], 0.9).sum() == 0
