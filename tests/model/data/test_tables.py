"""The user's table: what is read from it, and what is said when it cannot be."""

from __future__ import annotations

import numpy as np
import pytest

from naisr_model.covariates import Covariate, Population
from naisr_model.data.split import held_out_mask
from naisr_model.data.tables import population_from_table, read_table, write_table
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
