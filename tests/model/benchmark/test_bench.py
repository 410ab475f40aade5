"""The benchmark runs from end to end. No time is asserted."""

import json
import math

import pytest
import torch

from naisr_model import cli
from naisr_model.benchmark import window
from naisr_model.benchmark.bench import bench, figures
from naisr_model.benchmark.subject import QUICK, Scope
from naisr_model.benchmark.timing import Impossible
from naisr_model.errors import Cancelled, InputError
from naisr_model.progress import Progress


def test_every_figure_has_a_key_of_its_own():
    for scope in (QUICK, Scope()):
        keys = [figure.key for figure in figures(scope)]
        assert len(set(keys)) == len(keys)
    assert all(figure.definition for figure in figures(QUICK))


def test_the_smoke_run_measures_everything_but_the_missing_window(egg_atlas, tmp_path, monkeypatch, capsys):
    def no_window(atlas, file, device):
        raise Impossible("Not measured: the window; there is no display.")

    monkeypatch.setattr(window, "watched", no_window)
    target = tmp_path / "figures.json"
    assert cli.main(["bench", str(egg_atlas), "--quick", "--json", str(target)]) == 0
    record, printed = json.loads(target.read_text()), capsys.readouterr().out
    keys = {figure.key for figure in figures(QUICK)} & record.keys()
    assert {
        "exact_speedup_32", "exact_speedup_48", "exact_32_s", "evaluation_growth_exponent",
        "peak_memory_64_mb", "drag_p95_ms", "drag_mean_voxels", "drag_p99_voxels", "drag_flagged_share",
        "table_build_s", "train_speedup", "train_points_per_s",
    } == keys  # fmt: skip
    assert all(math.isfinite(record[key]) and record[key] >= 0 for key in keys)
    assert all(key in printed and key in record["definitions"] for key in keys)
    assert record["remarks"] == ["Not measured: the window; there is no display."]
    assert record["remarks"][0] in printed
    assert record["machine"]["cores"] >= 1 and record["versions"]["torch"] == torch.__version__


def test_it_stops_when_asked(egg_atlas):
    with pytest.raises(Cancelled):
        bench(egg_atlas, QUICK, progress=Progress(is_unwanted=lambda: True))


def test_another_model_is_not_measured(egg_deepsdf):
    with pytest.raises(InputError, match="DeepSDF is not measured; give an atlas of NAISR"):
        bench(egg_deepsdf, QUICK)
