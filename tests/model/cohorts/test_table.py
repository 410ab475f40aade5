"""How the table of a cohort is understood."""

from __future__ import annotations

from pathlib import Path

import pytest
from eggs import untrained

from naisr_model.cohorts.table import CohortTable, read_cohort
from naisr_model.errors import InputError

COVARIATES = untrained().population.covariates
"""Age in years, 1 to 9, and sex, F or M."""


@pytest.fixture
def understood(tmp_path):
    (tmp_path / "a.stl").write_text("a")

    def read(*lines: str) -> CohortTable:
        (tmp_path / "table.csv").write_text("\n".join(lines) + "\n")
        return read_cohort(tmp_path / "table.csv", COVARIATES)

    return read


def test_what_is_known_and_what_is_inferred(understood):
    table = understood(
        "mesh;subject;Age [years];sex;site", "a.stl;A;6,5;f;x", "a.stl;B;;M;", "a.stl;B;n/a;;z"
    )
    assert [row.known for row in table.rows] == [(("age", 6.5), ("sex", -1.0)), (("sex", 1.0),), ()]
    assert [row.visit for row in table.rows] == ["1", "1", "2"]
    assert [row.copied for row in table.rows] == [("x",), ("",), ("z",)]
    assert [row.number for row in table.rows] == [2, 3, 4]
    assert not any(row.fault for row in table.rows)
    assert table.rows[0].scan.name == "a.stl" and table.rows[0].scan.exists()


def test_the_summary_shows_a_column_that_is_misspelt(understood):
    table = understood("mesh,subject,agee", "a.stl,A,6")
    assert table.summary == (
        "table.csv: 1 rows, 1 subjects",
        "  inferred of everybody, without a column: age, sex",
        "  no covariates of the atlas, copied: agee",
    )


@pytest.mark.parametrize(
    ("cells", "fault"),
    [
        ("b.stl,A,1,6,", "b.stl does not exist; correct the path"),
        (",A,1,6,", "there is no mesh; fill it in"),
        ("a.stl,,1,6,", "there is no subject; fill it in"),
        ("a.stl,A,1,six,", "covariate 'age' is 'six'; expected a number in years"),
        ("a.stl,A,1,99,", "the atlas was trained on 1 to 9 years"),
        ("a.stl,A,1,,X", "covariate 'sex' is 'X'; expected F or M"),
        ("a.stl,A,1,six,X", "expected a number in years; covariate 'sex' is 'X'"),
    ],
)
def test_a_row_that_cannot_be_used_stops_no_other(understood, cells, fault):
    bad, good = understood("mesh,subject,visit,age,sex", cells, "a.stl,Z,1,6,F").rows
    assert fault in bad.fault and not good.fault


def test_of_rows_of_one_visit_none_is_used(understood):
    rows = understood("mesh,subject,visit", "a.stl,A,1", "a.stl,A,1", "a.stl,A,2").rows
    told = "rows 2-3 are visit '1' of subject 'A'; give each visit its own name"
    assert [row.fault for row in rows] == [told, told, ""]


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (["subject,age", "A,6"], "table.csv has no column 'mesh'; add one with the path of each scan"),
        (["mesh,age", "a.stl,6"], "no column 'subject'"),
        (["mesh,subject"], "has a header but no rows"),
        (["mesh,subject,age [months]", "a.stl,A,6"], "in months by the header .* in years; convert"),
        (["mesh,subject,age,AGE", "a.stl,A,6,6"], "has the column both 'age' and 'AGE'; rename one"),
    ],
)
def test_a_table_that_cannot_be_used(understood, lines, message):
    with pytest.raises(InputError, match=message):
        understood(*lines)


def test_no_table_at_all(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        read_cohort(Path(tmp_path / "none.csv"), COVARIATES)
