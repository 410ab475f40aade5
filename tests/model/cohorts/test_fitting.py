"""A cohort fitted: what is found, a run that was killed, a row that was corrected, what is refused."""

from __future__ import annotations

import csv
import io
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest
from eggs import egg

from naisr_model import cli
from naisr_model.atlas import Atlas
from naisr_model.cohorts.fitting import fit_cohort
from naisr_model.cohorts.results import Cohort, as_csv
from naisr_model.errors import InputError
from naisr_model.progress import Progress

REJECTED = {
    5: "nowhere.stl does not exist",
    6: "text.stl is no STL file",
    7: "covariate 'age' is 'old'; expected a number in years",
    8: "covariate 'age' is 999 years; the atlas was trained on 1 to 9 years",
    10: "rows 10-11 are visit '1' of subject 'H'; give each visit its own name",
    11: "rows 10-11 are visit '1' of subject 'H'; give each visit its own name",
    12: "far.stl: the shape lies 900 mm from the middle of the atlas",
    13: "volume.nii.gz has no label 7",
}
"""Row by row, what is said of those that cannot be used."""


@pytest.fixture(scope="module")
def out(tmp_path_factory) -> Path:
    return Path(tmp_path_factory.mktemp("fitted") / "out")


@pytest.fixture(scope="module")
def cohort(egg_atlas, cohort_table, out) -> Cohort:
    return fit_cohort(cohort_table, egg_atlas, out, workers=1)


def rows_of(content: bytes) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(content.decode())))


def untimed(content: bytes) -> list[dict[str, str]]:
    """All but the seconds, which nothing repeats."""
    return [{name: cell for name, cell in row.items() if name != "seconds"} for row in rows_of(content)]


def test_every_row_is_there_with_its_result_or_its_reason(cohort, out):
    rows = rows_of((out / "results.csv").read_bytes())
    assert [int(row["row"]) for row in rows] == list(range(2, 14))
    for row in rows:
        expected = REJECTED.get(int(row["row"]), "")
        assert row["status"] == ("rejected" if expected else "fitted")
        assert expected in row["reason"] and bool(expected) == bool(row["reason"])
    assert [row["site"] for row in rows][-2:] == ["<south>", "south"]


def test_the_numbers_are_those_of_the_eggs(cohort, out):
    rows = {int(row["row"]): row for row in rows_of((out / "results.csv").read_bytes())}
    for number, truth in ((2, egg(6.0, 1.0)), (3, egg(6.0, 1.0)), (4, egg(6.0, 1.0)), (9, egg(3.0, -1.0))):
        row = rows[number]
        assert float(row["volume_cm3"]) == pytest.approx(truth.volume / 1000, rel=0.02)
        assert float(row["area_cm2"]) == pytest.approx(truth.area / 100, rel=0.02)
        assert float(row["volume_low_cm3"]) < float(row["volume_cm3"]) < float(row["volume_high_cm3"])
        assert 0 < float(row["volume_percentile"]) < 100 and 0 < float(row["residual_mm"]) < 0.3
        assert len([name for name in row if name.startswith("code_")]) == 4
    known, inferred = rows[2], rows[3]
    assert (known["age"], known["age_low"], known["sex"], known["inferred"]) == ("6.0", "", "M", "")
    assert inferred["inferred"] == "age, sex" and inferred["sex"] == "M"
    assert float(inferred["age"]) == pytest.approx(6.0, abs=0.5)
    assert float(inferred["age_low"]) < float(inferred["age"]) < float(inferred["age_high"])
    assert float(known["scan_volume_cm3"]) == pytest.approx(egg(6.0, 1.0).volume / 1000)


def test_parquet_holds_the_same(cohort, out):
    table = pyarrow.parquet.read_table(out / "results.parquet")
    rows = rows_of((out / "results.csv").read_bytes())
    assert table.column_names == list(rows[0])
    for name in table.column_names:
        cells = [row[name] for row in rows]
        for cell, value in zip(cells, table[name].to_pylist(), strict=True):
            assert cell == ("" if value is None else str(value))
    assert str(table.schema.field("row").type) == "int64"
    assert str(table.schema.field("volume_cm3").type) == "double"


def test_the_page_needs_nothing_else_and_shows_the_most_unusual_first(cohort, out):
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "4 of 12 scans fitted" in page and page.count("<svg") == 2
    assert "src=" not in page and "<script" not in page
    table = page[page.index("The most unusual first") :]
    subjects = [row.partition("</td><td>")[2][0] for row in table.split("<tr><td>")[1:5]]
    scores = {
        one.row.subject: abs(one.record["measures"]["volume"]["z"])
        for one in cohort.fitted
        if one.row.visit == "1"
    }
    assert subjects[0] == max(scores, key=lambda subject: scores[subject])
    assert "covariate &#x27;age&#x27; is &#x27;old&#x27;" in table


def test_a_percentile_is_among_people_of_the_same_covariates(cohort, egg_atlas):
    atlas, (one, *_) = Atlas.load(egg_atlas), cohort.fitted
    volumes = np.array(
        [
            atlas.shape(atlas.population.row(int(row)), code).volume
            / atlas.shape(atlas.population.row(int(row))).volume
            for row, code in zip(
                np.flatnonzero(~atlas.population.held_out), atlas.checkpoint.latents, strict=True
            )
        ]
    )
    usual = atlas.shape(dict(one.row.known)).volume / 1000
    told = one.record["measures"]["volume"]
    assert told["percentile"] == pytest.approx(100 * np.mean(volumes * usual < told["value"]), abs=15)


def test_a_run_that_was_killed_goes_on_to_the_same_table(cohort, egg_atlas, cohort_table, tmp_path):
    words = ["cohort", "fit", str(cohort_table), "--atlas", str(egg_atlas), "--out", str(tmp_path)]
    command = [sys.executable, "-m", "naisr_model.cli", *words, "--workers", "2"]
    journal = tmp_path / "journal.jsonl"
    run = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        while run.poll() is None and not (journal.exists() and _fits(journal)):
            time.sleep(0.02)
    finally:
        run.send_signal(signal.SIGKILL)
        run.wait()
    assert 0 < _fits(journal) < 4 and not (tmp_path / "results.csv").exists()
    with journal.open("ab") as file:
        file.write(b'{"key": "half a li')
    kept = journal.read_bytes()
    assert cli.main([*words, "--workers", "1"]) == 0
    assert untimed((tmp_path / "results.csv").read_bytes()) == untimed(as_csv(cohort))
    assert journal.read_bytes().startswith(kept.rpartition(b"\n")[0])
    assert _fits(journal) == 4


def test_a_cluster_that_loses_a_worker_gives_the_same_table(cohort, egg_atlas, cohort_table, tmp_path):
    pytest.importorskip("distributed", reason="the extra 'cluster' is not installed")
    import psutil

    killed: list[psutil.Process] = []

    def kill_one(_share: float) -> None:
        if not killed and (tmp_path / "journal.jsonl").exists() and _fits(tmp_path / "journal.jsonl"):
            workers = [
                each
                for each in psutil.Process().children()
                if any("spawn_main" in word for word in each.cmdline())
            ]
            assert len(workers) == 2
            workers[0].kill()
            killed.append(workers[0])

    found = fit_cohort(cohort_table, egg_atlas, tmp_path, cluster="local:2", progress=Progress(kill_one))
    assert killed and untimed(as_csv(found)) == untimed(as_csv(cohort))
    assert _fits(tmp_path / "journal.jsonl") == 4


def _fits(journal: Path) -> int:
    return journal.read_bytes().count(b'"latent"')


def test_only_what_was_corrected_is_fitted_again(cohort, egg_atlas, cohort_table, out):
    before = (out / "journal.jsonl").read_text().splitlines()
    corrected = cohort_table.with_name("corrected.csv")
    corrected.write_text(cohort_table.read_text().replace(",old,F,", ",6,M,"))
    found = fit_cohort(corrected, egg_atlas, out, workers=1)
    after = (out / "journal.jsonl").read_text().splitlines()
    assert after[: len(before)] == before and len(after) == len(before) + 1
    assert json.loads(after[-1])["key"].startswith("E/1/")
    assert len(found.fitted) == 5 and len(found.rejected) == 7


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--measure", "girth"], "there is no measure 'girth'; give volume, area, length, narrowest"),
        (
            ["--workers", "2", "--cluster", "local:2"],
            "--workers are processes on this machine, --cluster has",
        ),
        (["--workers", "0"], "the number of workers is 0"),
        (["--align", "icp"], "keeps a run with another align; name another journal"),
    ],
)
def test_what_is_refused(cohort, egg_atlas, cohort_table, out, words, message, capsys):
    given = ["cohort", "fit", str(cohort_table), "--atlas", str(egg_atlas), "--out", str(out), *words]
    assert cli.main(given) == 2
    assert message in capsys.readouterr().err


def test_results_of_somebody_else_are_not_replaced(egg_atlas, cohort_table, tmp_path):
    (tmp_path / "results.csv").write_text("mine")
    with pytest.raises(InputError, match=r"holds results\.csv of something else; give another folder"):
        fit_cohort(cohort_table, egg_atlas, tmp_path)
    assert os.listdir(tmp_path) == ["results.csv"]


def test_a_column_that_the_results_have_themselves(egg_atlas, cohort_table, tmp_path):
    table = cohort_table.with_name("clash.csv")
    table.write_text("mesh,subject,seconds\nwhole.stl,A,3\n")
    with pytest.raises(InputError, match="a column 'seconds' of their own; rename that of clash"):
        fit_cohort(table, egg_atlas, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_an_atlas_that_knows_no_norms_says_so(egg_deepsdf, cohort_table, tmp_path):
    table = cohort_table.with_name("one.csv")
    table.write_text("mesh,subject,age\nwhole.stl,A,6\n")
    found = fit_cohort(table, egg_deepsdf, tmp_path, workers=1)
    (row,) = rows_of(as_csv(found))
    assert found.without.startswith("no percentiles: ") and found.table.copied == ("age",)
    assert row["volume_percentile"] == "" and row["age"] == "6" and row["status"] == "fitted"
