"""Completion is measured against parts that are known."""

from __future__ import annotations

import json

import numpy as np
import pytest
import trimesh
from eggs import egg

from naisr_model import cli
from naisr_model.evaluation.studies.completion import CUTS, WAYS, completed, cut_away


@pytest.mark.parametrize("cut", CUTS)
def test_a_third_of_the_area_is_cut_away(cut):
    mesh = egg(6.0, 1.0).subdivide()
    missing = cut_away(mesh, cut, seed=1)
    assert mesh.area_faces[missing].sum() / mesh.area == pytest.approx(1 / 3, abs=0.01)
    heights = mesh.triangles_center[:, 2]
    if cut == "below":
        assert heights[missing].max() <= heights[~missing].min()
    elif cut == "above":
        assert heights[missing].min() >= heights[~missing].max()
    else:
        assert (missing != cut_away(mesh, cut, seed=2)).any()
        pieces = mesh.submesh([np.flatnonzero(missing)], append=True).body_count
        assert pieces == 1


def test_completion_measures_both_parts_from_the_command_line(egg_atlas, egg_store, tmp_path, capsys):
    record = tmp_path / "completion.json"
    words = ["evaluate", "completion", str(egg_atlas), "--store", str(egg_store.path)]
    assert cli.main([*words, "--limit", "1", "--json", str(record)]) == 0
    report, text = json.loads(record.read_text()), capsys.readouterr().out
    assert report["n"] == 1 and "from below, covariates inferred" in text
    for cut in CUTS:
        for way in WAYS:
            assert report[cut][way]["seen_mm"]["mean"] < 2.5
            assert report[cut][way]["missing_mm"]["mean"] < report[cut][way]["missing_hd95_mm"]["mean"] < 12
        assert report[cut]["given"]["missing_mm"]["mean"] < 2.5
    assert cli.main([*words, "--limit", "-1"]) == 2
    assert "--limit is -1" in capsys.readouterr().err


def test_the_missing_part_is_told_from_the_seen_one():
    """A shape, cut, and a wrong one that is right where the cut left something."""
    mesh = egg(6.0, 1.0).subdivide()
    longer = mesh.copy()
    longer.vertices[:, 2] *= np.where(longer.vertices[:, 2] < 0, 1.2, 1.0)
    missing = cut_away(mesh, "below")
    found = completed(mesh, missing, longer)
    assert found is not None
    assert found.seen_mm < 0.6 < 1.5 < found.missing_mm < found.missing_hd95_mm <= 0.2 * 32 + 0.1
    assert found.vd_cm3 == pytest.approx(abs(longer.volume - mesh.volume) / 1000)
    assert completed(mesh, missing, trimesh.Trimesh()) is None
