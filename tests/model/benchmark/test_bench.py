"""The benchmark runs from end to end; what it counts and embeds is right. No time is asserted."""

import dataclasses
import json
import math

import pytest
import torch

from naisr_model import cli
from naisr_model.atlas import Atlas
from naisr_model.benchmark import bench
from naisr_model.benchmark.paper_size import at_paper_size, paper_sized
from naisr_model.config import NetworkConfig, SirenConfig
from naisr_model.errors import Cancelled, InputError
from naisr_model.models.naisr.network import Naisr


@pytest.mark.parametrize("hidden", [1, 2, 3, 4])
@pytest.mark.parametrize("dim", [2, 3])
def test_the_paper_s_size_leaves_the_fields_as_they_are(hidden, dim):
    torch.manual_seed(hidden)
    config = NetworkConfig(dim, 6, SirenConfig(40, hidden, 10.0), SirenConfig(24, hidden, 3.0))
    small = Naisr(config, covariates=2)
    for weight in small.parameters():
        weight.data *= 1.3
    large = at_paper_size(small)
    assert large.config == dataclasses.replace(NetworkConfig(), dim=dim)
    points, covariates, codes = torch.rand(2, 500, dim) * 2 - 1, torch.randn(2, 2), torch.randn(2, 6)
    with torch.inference_mode():
        value, displacement = small(points, covariates, codes)
        same, as_far = large(points, covariates, torch.nn.functional.pad(codes, (0, 250)))
    assert displacement.abs().max() > 1e-3
    torch.testing.assert_close(same, value, atol=1e-5, rtol=0)
    torch.testing.assert_close(as_far, displacement, atol=1e-5, rtol=0)


def test_embedded_networks_work_without_denormal_numbers(egg_atlas):
    weights = paper_sized(Atlas.load(egg_atlas)).checkpoint.weights.values()
    tiny = torch.finfo(torch.float32).tiny
    assert all(((weight == 0) | (weight.abs() >= tiny)).all() for weight in weights)


def test_larger_networks_than_the_paper_s_are_refused():
    with pytest.raises(InputError, match="larger networks"):
        at_paper_size(Naisr(NetworkConfig(latent=300), covariates=1))


def test_evaluations_are_counted(egg_atlas):
    asked = []

    def sphere(points):
        asked.append(len(points))
        return ((points**2).sum(axis=1) ** 0.5 - 0.5).astype("float32")

    assert bench.evaluations(sphere, 64) == sum(asked)
    assert math.log2(bench.evaluations(sphere, 128) / bench.evaluations(sphere, 64)) < 2.2


def test_a_verdict_follows_the_target():
    more, less = bench.Figure("a", "", "", at_least=2.0), bench.Figure("b", "ms", "", at_most=33.0)
    assert more.target == "≥ 2" and less.target == "≤ 33 ms"
    assert [more.verdict(value) for value in (1.9, 2.0)] == ["no", "yes"]
    assert [less.verdict(value) for value in (33.0, 34.0)] == ["yes", "no"]
    assert bench.Figure("c", "s", "").verdict(1.0) == ""


def test_the_smoke_run_measures_everything_but_the_missing_window(egg_atlas, tmp_path, monkeypatch, capsys):
    def no_window(atlas, file, device):
        raise bench.Impossible("Not measured: the window; there is no display.")

    monkeypatch.setattr(bench, "watched", no_window)
    target = tmp_path / "figures.json"
    assert cli.main(["bench", str(egg_atlas), "--quick", "--json", str(target)]) == 0
    record, printed = json.loads(target.read_text()), capsys.readouterr().out
    keys = {figure.key for figure in bench.figures(bench.QUICK)} & record.keys()
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


def test_what_the_window_says_of_itself_is_passed_on(egg_atlas, monkeypatch):
    told = iter(
        [dict.fromkeys(bench.WINDOW, value) | {"events": 10, "frames_dropped": 4} for value in (3, 1, 2)]
    )
    monkeypatch.setattr(bench, "watched", lambda atlas, file, device: next(told))
    scope = dataclasses.replace(bench.QUICK, viewer_runs=3)
    figures = bench.window(bench.Subject(egg_atlas, Atlas.load(egg_atlas), scope))
    assert figures == dict.fromkeys(bench.WINDOW, 2.0) | {"frames_dropped_share": 0.4}


def test_it_stops_when_asked(egg_atlas):
    with pytest.raises(Cancelled):
        bench.bench(egg_atlas, bench.QUICK, should_stop=lambda: True)
