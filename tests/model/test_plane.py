"""An atlas in the plane, from a user's curves to fits and files, against ellipses whose truth is known."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from eggs import ellipse

from naisr_model import cli
from naisr_model.atlas import Atlas
from naisr_model.data.curves import sound_curve
from naisr_model.data.prepare import PrepareOptions, prepare
from naisr_model.errors import InputError
from naisr_model.evaluation.metrics import compare
from naisr_model.shapes.curve import Curve


@pytest.fixture(scope="module")
def made(ellipses) -> Path:
    return ellipses


@pytest.fixture(scope="module")
def atlas(made) -> Atlas:
    return Atlas.load(made / "a.safetensors")


def test_shapes_are_closed_curves_with_the_true_area(atlas) -> None:
    for age in (2.0, 5.0, 8.0):
        curve = atlas.shape({"age": age}, resolution=64)
        assert isinstance(curve, Curve) and curve.pieces == 1
        assert curve.volume == pytest.approx(math.pi * 10 * (10 + age), rel=0.05)
        assert np.abs(atlas.sdf(curve.vertices, {"age": age})).max() < 0.1
    assert (atlas.extent.title, atlas.extent.unit) == ("area", "mm²")
    grown = atlas.shape({"age": 8.0}).bounds[1] - atlas.effect("age", 2.0).bounds[1]
    assert grown == pytest.approx([0, 6], abs=0.8)


def test_a_fit_finds_the_age_and_says_how_sure_it_is(atlas) -> None:
    fit = atlas.fit(ellipse(7.0))
    assert fit.is_valid and fit.covariates["age"] == pytest.approx(7.0, abs=1.0)
    low, high = fit.extent_interval
    assert low < fit.extent < high and fit.extent == pytest.approx(math.pi * 170, rel=0.05)
    found = compare(ellipse(7.0), fit.shape(), samples=1000, emd_samples=100)
    assert found["hd_x100"] < 8 and found["ad"] < 30
    assert fit.placing_mm(ellipse(7.0)).motion.shape == (3, 3)
    with pytest.raises(InputError, match="no volume"):
        _ = fit.volume_cm3
    points = ellipse(7.0).vertices
    assert atlas.fit(points, {"age": 7.0}).residual_mm < 1.0


def test_commands_write_curves_and_tell_areas(made, capsys) -> None:
    file, out = str(made / "a.safetensors"), made / "out"
    cli.main(["mesh", file, str(made / "m.svg"), "--set", "age=8"])
    assert sound_curve(made / "m.svg").curve.volume == pytest.approx(math.pi * 180, rel=0.05)
    assert "mm²" in capsys.readouterr().out
    cli.main(
        ["fit", str(made / "c15.csv"), "--atlas", file, "--out", str(out), "--json", str(made / "f.json")]
    )
    assert "area: " in capsys.readouterr().out
    record = json.loads((made / "f.json").read_text())
    low, high = record["area_interval_mm2"]
    assert low < record["area_mm2"] < high
    names = {path.name for path in out.iterdir()}
    assert names == {"shape01.svg", "shape01.csv", "shapes.png", "volumes.csv"}
    assert sound_curve(out / "shape01.csv").curve.volume == pytest.approx(record["area_mm2"], rel=0.01)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["mesh", "ATLAS", "m.stl"], "name the file .svg or .csv"),
        (["fit", "c3.csv", "--atlas", "ATLAS", "--align", "icp"], "leave out --align"),
        (["fit", "ellipses.csv", "--atlas", "ATLAS"], "holds no curve in the plane"),
        (["measure", "ATLAS"], "surfaces alone are measured"),
        (["evaluate", "completion", "ATLAS", "--store", "store"], "curves in the plane"),
        (["train", "store", "--out", "b.safetensors", "--preset", "demo"], "the preset is for 3D shapes"),
    ],
)
def test_what_has_no_sense_in_the_plane_is_one_sentence(words, said, made, capsys, monkeypatch) -> None:
    monkeypatch.chdir(made)
    code = cli.main(["a.safetensors" if word == "ATLAS" else word for word in words])
    assert code == 2 and said in capsys.readouterr().err


def test_a_curve_among_meshes_is_told(egg_table, made, tmp_path) -> None:
    rows = [line.split(",") for line in egg_table.read_text().splitlines()[1:]]
    lines = [",".join([str(egg_table.parent / mesh), *rest]) for mesh, *rest in rows[:8]]
    odd = ",".join([str(made / "c3.csv"), "odd", "1", "3", rows[0][-1]])
    (tmp_path / "mixed.csv").write_text("\n".join([egg_table.read_text().splitlines()[0], *lines, odd]))
    report = prepare(
        tmp_path / "mixed.csv", tmp_path / "store", options=PrepareOptions(100, 100, 100, 0.2, workers=1)
    )
    assert [remark.row for remark in report.rejected] == [10]
    assert "it is a curve, most others are meshes" in report.rejected[0].reason
