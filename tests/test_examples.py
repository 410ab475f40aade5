"""The examples run as a reader runs them, and what they print is true."""

from __future__ import annotations

import importlib.util
import math
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from naisr_model.data.populations import PopulationModule, population
from naisr_model.data.store import SampleStore

ROOT = Path(__file__).parents[1]
EXAMPLES = ROOT / "resources" / "examples"


def said(example: str, out: Path) -> str:
    """What an example prints, with its files in ``out``."""
    # This checkout, whatever is installed; small networks are fastest on one thread.
    environment = os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, str(EXAMPLES / example), str(out)]
    run = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    assert run.returncode == 0, run.stderr
    return run.stdout


def numbers(text: str, start: str) -> list[float]:
    """All numbers in the one line of a text that begins so."""
    (line,) = [line for line in text.splitlines() if line.startswith(start)]
    return [float(number) for number in re.findall(r"-?\d+(?:\.\d+)?", line.removeprefix(start))]


def test_exploring_an_atlas_finds_the_growth_of_its_population(tmp_path: Path) -> None:
    text = said("explore_an_atlas.py", tmp_path)
    alone = [numbers(text, f"age only, {months} months")[-1] for months in (24, 120, 200)]
    assert alone == sorted(alone)
    for months in (60, 90, 117, 170, 220):
        weight_kg, found_cm3 = numbers(text, f"boy of {months} months and")
        true = population("airway").true_shape({"age": months, "weight": weight_kg, "sex": 1.0})
        # The atlas is known to be 5 % off at worst; the example's coarse lattice adds to it.
        assert found_cm3 == pytest.approx(true.volume / 1000, rel=0.08)
        written = trimesh.load_mesh(tmp_path / f"boy_{months}_months.ply")
        assert written.volume / 1000 == pytest.approx(found_cm3, rel=0.15)
    voxel_mm = 2 * 58 / 128
    assert numbers(text, "99 % of the carried vertices are within")[0] < voxel_mm


def test_own_data_become_an_atlas_that_shows_what_was_in_them(tmp_path: Path) -> None:
    text = said("own_data.py", tmp_path)
    assert "24 shapes prepared, 0 rejected" in text
    for age, sex in ((2, "-1"), (5, "+1"), (8, "+1")):
        found_cm3 = numbers(text, f"age {age}, sex {sex}:")[0]
        true_cm3 = 4 / 3 * math.pi * (20 + 2 * int(sex)) * 20 * (20 + 2 * age) / 1000
        assert found_cm3 == pytest.approx(true_cm3, rel=0.06)


def test_a_patient_is_fitted_and_carried_to_another_day(tmp_path: Path) -> None:
    text = said("fit_a_patient.py", tmp_path)
    _, true_weight_kg, _ = numbers(text, "the truth:")
    (true_cm3,) = numbers(text, "true volume:")
    _, _, low_kg, high_kg = numbers(text, "weight:")
    assert low_kg <= true_weight_kg <= high_kg
    now_cm3, _, low_cm3, high_cm3 = numbers(text, "volume:")
    assert low_cm3 <= true_cm3 <= high_cm3
    assert numbers(text, "mean distance of the scan to the fitted surface:")[0] < 0.5
    later_cm3 = numbers(text, "three years later:")[0]
    assert later_cm3 > now_cm3
    fitted, later = (trimesh.load_mesh(tmp_path / name) for name in ("fitted.ply", "later.ply"))
    assert fitted.volume / 1000 == pytest.approx(now_cm3, rel=0.04)
    assert later.volume / 1000 == pytest.approx(later_cm3, rel=0.04)


def test_a_new_population_is_prepared_as_it_was_made(tmp_path: Path) -> None:
    text = said("a_new_population.py", tmp_path)
    assert "0 rejected" in text
    spec = importlib.util.spec_from_file_location("bones", EXAMPLES / "a_new_population.py")
    assert spec is not None and spec.loader is not None
    bones = importlib.util.module_from_spec(spec)
    sys.modules["bones"] = bones  # dataclasses look their module up
    spec.loader.exec_module(bones)
    assert all(hasattr(bones, name) for name in vars(PopulationModule) if not name.startswith("_"))
    store = SampleStore.open(tmp_path / "store")
    people = {(one.subject, one.visit): one for one in bones.visits(0, 12)}
    assert len(store) == len(people)
    for row, key in enumerate(zip(store.population.subjects, store.population.visits, strict=True)):
        true = bones.visit_shape(people[key])[0]
        assert store.mesh(row).volume == pytest.approx(true.volume, rel=1e-3)
    held_out = np.array(store.population.subjects)[store.population.held_out]
    learnt = np.array(store.population.subjects)[~store.population.held_out]
    assert len(held_out) and not set(held_out) & set(learnt)


def test_a_new_view_shows_how_fast_the_population_grows(tmp_path: Path) -> None:
    """Mean speed times area is the growth of the volume, which the population's truth tells."""
    told = numbers(said("a_new_view.py", tmp_path), "at 36 months the airway grows by")
    true = [
        population("airway").true_shape({"age": months, "weight": 14.0, "sex": 0.0})
        for months in (30, 36, 42)
    ]
    expected = (true[2].volume - true[0].volume) / true[1].area
    assert told[-1] == pytest.approx(expected, abs=0.15)
    assert (tmp_path / "growth.png").stat().st_size > 10_000
