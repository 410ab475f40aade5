"""Starman as the paper's section has it."""

from __future__ import annotations

import numpy as np
import pytest

from naisr_model.data.curves import crossing
from naisr_model.data.populations import starman
from naisr_model.data.split import held_out_mask
from naisr_model.errors import InputError


def test_at_the_papers_size_there_are_the_papers_shapes() -> None:
    visits = starman.visits(287)
    subjects = [visit.subject for visit in visits]
    held_out = held_out_mask(subjects, 0.5)
    assert [int((~held_out).sum()), int(held_out.sum())] == [5041, 4966]
    assert len(set(subjects)) == 2000
    assert max(int(visit.visit) for visit in visits) == 10
    values = np.array([[visit.values["arms"], visit.values["legs"]] for visit in visits])
    assert np.abs(values).max() <= 1 and np.abs(values.mean(axis=0)).max() < 0.02


def test_covariates_deform_as_the_papers_equations_say() -> None:
    man, centre = (starman.true_shape({"arms": a, "legs": 0.8 * a}).vertices for a in (0.5, 0.0))
    expected = np.zeros_like(centre)
    for place, strength, move in zip(starman.CONTROLS, [0.5, 0.5, 0.4, 0.4], starman.MOVES, strict=True):
        weight = np.exp(-((centre - place) ** 2).sum(axis=1) / (2 * 0.5**2))
        expected += strength * weight[:, None] * move
    assert man - centre == pytest.approx(expected, abs=1e-12)
    assert np.allclose(starman.MOVES[2], -starman.MOVES[3])


def test_one_subject_is_one_deformation_in_every_pose_and_no_shape_crosses_itself() -> None:
    visits = starman.visits(3, 12)
    by_subject: dict[str, list[np.ndarray]] = {}
    for visit in visits:
        shape = starman.visit_shape(visit)[0]
        assert crossing(shape) is None and shape.volume > 0.5
        by_subject.setdefault(visit.subject, []).append(visit.momenta)
    assert all(np.ptp(momenta, axis=0).max() == 0 for momenta in map(np.array, by_subject.values()))
    first, second = (momenta[0] for momenta in list(by_subject.values())[:2])
    assert np.abs(first - second).max() > 0.01


def test_the_same_seed_makes_the_same_files(tmp_path) -> None:
    for folder in ("a", "b"):
        starman.write_population(tmp_path / folder, seed=1, patients=2)
    names = {path.relative_to(tmp_path / "a") for path in (tmp_path / "a").rglob("*.*")}
    assert names == {path.relative_to(tmp_path / "b") for path in (tmp_path / "b").rglob("*.*")}
    assert all((tmp_path / "a" / n).read_bytes() == (tmp_path / "b" / n).read_bytes() for n in names)
    with pytest.raises(InputError, match="needs a value for 'legs'"):
        starman.true_shape({"arms": 0.0})
