"""The fast fit and the paper's procedure on the same egg."""

from __future__ import annotations

from typing import Any

import pytest

from naisr_model.errors import InputError
from naisr_model.evaluation.studies.fitting import Fitting
from naisr_model.evaluation.study import run


def test_both_ways_are_measured_on_the_same_shape(egg_atlas, egg_store):
    study = Fitting(egg_atlas, store=egg_store.path, limit=1, steps=40)
    report = run(study)
    assert report["n"] == 1 and report["no_worse"] in (0, 1) and report["times_faster"] > 0
    assert report["residual_mm"]["fast"] < 0.5
    assert "40 Adam steps" in study.markdown(report)


def test_means_are_over_shapes_and_times_in_all(egg_atlas):
    records = [
        {
            "fast": {"residual_mm": 0.1, "seconds": 1.0},
            "reference": {"residual_mm": 0.3, "seconds": 10.0},
        },
        {
            "fast": {"residual_mm": 0.2, "seconds": 3.0},
            "reference": {"residual_mm": 0.1, "seconds": 30.0},
        },
    ]
    report = Fitting(egg_atlas).summarise(records)
    assert report["residual_mm"] == pytest.approx({"fast": 0.15, "reference": 0.2})
    assert report["seconds"] == pytest.approx({"fast": 2.0, "reference": 20.0})
    assert (report["n"], report["no_worse"], report["times_faster"]) == (2, 0.5, pytest.approx(10.0))


@pytest.mark.parametrize("option", ["limit", "steps"])
def test_nothing_to_fit_is_refused(egg_atlas, option):
    none: dict[str, Any] = {option: 0}
    with pytest.raises(InputError, match=f"--{option} is 0; give 1 or more"):
        run(Fitting(egg_atlas, **none))
