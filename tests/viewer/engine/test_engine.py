"""Requests answered by a stand-in atlas whose volumes are known in closed form."""

from __future__ import annotations

import inspect
from pathlib import Path

import numpy as np
import pytest
import trimesh

from naisr_model.atlas import Atlas
from naisr_model.errors import Cancelled, InputError
from naisr_model.progress import Progress
from naisr_viewer.engine import cache
from naisr_viewer.engine.engine import CACHED_SURFACES, Engine
from naisr_viewer.state.layouts import FULL_SHAPE, TEMPLATE, Panel
from naisr_viewer.state.requests import Origin, SurfaceRequest

UNWANTED = Progress(is_unwanted=lambda: True)


def ask(path: Path, panel: Panel = FULL_SHAPE, resolution: int = 128, **values: float) -> SurfaceRequest:
    return SurfaceRequest(path, panel, tuple(values.items()), resolution)


@pytest.mark.parametrize("method", ["shape", "effect", "template", "tabulate", "tracker"])
def test_the_stand_in_is_called_like_the_real_atlas(atlas, method):
    real, stand_in = (inspect.signature(getattr(kind, method)) for kind in (Atlas, type(atlas)))
    assert list(stand_in.parameters) == list(real.parameters)


def test_surfaces_have_the_true_volume(engine, card, atlas):
    cases: list[tuple[Panel, dict[str, float]]] = [
        (TEMPLATE, {}),
        (Panel("effect", "age"), {"age": 200.0}),
        (FULL_SHAPE, {"age": 20.0, "weight": 10.0, "sex": 1.0}),
    ]
    for panel, values in cases:
        result = engine.surface(SurfaceRequest(card.path, panel, tuple(values.items()), 128))
        assert result.extent == pytest.approx(atlas.volume_cm3(**values), rel=0.01)
        assert result.is_exact


def test_normals_are_unit_and_point_outwards(engine, card):
    result = engine.surface(ask(card.path))
    np.testing.assert_allclose(np.linalg.norm(result.normals, axis=1), 1, atol=1e-5)
    assert (np.sum(result.normals * result.points_mm, axis=1) > 0).all()


def test_an_answer_is_remembered(engine, card, atlas):
    first = engine.surface(ask(card.path, age=50.0))
    assert engine.surface(ask(card.path, age=50.0)).points_mm is first.points_mm
    remembered = engine.cached(ask(card.path, age=50.0))
    assert remembered is not None
    assert remembered.request == first.request
    assert engine.cached(ask(card.path, age=51.0)) is None
    assert len(atlas.calls) == 1


def test_equal_surfaces_are_computed_once(engine, card, atlas):
    template = engine.surface(ask(card.path, TEMPLATE))
    at_mean = engine.surface(ask(card.path, age=100.0, weight=35.0, sex=0.0))
    effect = engine.surface(ask(card.path, Panel("effect", "age"), age=60.0))
    alone = engine.surface(ask(card.path, age=60.0, weight=35.0, sex=0.0))
    assert at_mean.points_mm is template.points_mm
    assert alone.points_mm is effect.points_mm
    assert at_mean.request.panel == FULL_SHAPE  # each still answers its own question
    assert [what for what, _, _ in atlas.calls] == ["template", "age"]
    engine.surface(ask(card.path, age=60.0, weight=36.0, sex=0.0))
    assert [what for what, _, _ in atlas.calls] == ["template", "age", "shape"]


def test_the_memory_is_bounded(engine, card):
    for age in range(CACHED_SURFACES + 5):
        engine.surface(ask(card.path, resolution=40, age=float(age)))
    assert engine.cached(ask(card.path, resolution=40, age=0.0)) is None
    assert engine.cached(ask(card.path, resolution=40, age=float(CACHED_SURFACES))) is not None


def test_opening_a_file_again_forgets_its_old_surfaces(engine, card):
    engine.surface(ask(card.path))
    engine.open(card.path)
    assert engine.cached(ask(card.path)) is None


def test_cancelling_is_passed_on(engine, card):
    with pytest.raises(Cancelled):
        engine.surface(ask(card.path), UNWANTED)
    assert engine.cached(ask(card.path)) is None


def test_progress_is_passed_on(engine, card):
    seen: list[float] = []
    engine.surface(ask(card.path), Progress(seen.append))
    assert seen[-1] == 1.0


def test_no_surface_is_an_answer_too(engine, card, atlas, monkeypatch):
    monkeypatch.setattr(atlas, "_surface", lambda *_: trimesh.Trimesh())
    result = engine.surface(ask(card.path))
    assert result.faces.shape == (0, 3)
    assert result.points_mm.shape == (0, 3)
    assert result.extent == 0.0


def test_a_missing_file_is_named(engine, tmp_path):
    with pytest.raises(InputError, match="nowhere"):
        engine.open(tmp_path / "nowhere.safetensors")


def tabulations(atlas) -> int:
    return [what for what, _, _ in atlas.calls].count("tabulate")


def test_previews_carry_the_template_once_displacements_are_tabulated(engine, card, atlas):
    assert not engine.has_previews(card.path)
    engine.prepare_previews(card.path)
    assert engine.has_previews(card.path)
    template = engine.surface(ask(card.path, TEMPLATE))
    atlas.calls.clear()
    first = engine.surface(ask(card.path, resolution=40, age=150.0, weight=50.0))
    second = engine.surface(ask(card.path, resolution=40, age=151.0, weight=50.0))
    assert atlas.calls == []
    assert first.faces is second.faces
    np.testing.assert_array_equal(first.faces, template.faces)
    assert first.extent == pytest.approx(atlas.volume_cm3(age=150.0, weight=50.0), rel=0.01)
    assert not first.is_exact
    assert first.origin is Origin.TABLES


def test_equal_previews_are_carried_once(engine, card):
    engine.prepare_previews(card.path)
    alone = engine.surface(ask(card.path, Panel("effect", "age"), resolution=40, age=60.0))
    whole = engine.surface(ask(card.path, resolution=40, age=60.0, weight=35.0, sex=0.0))
    assert whole.points_mm is alone.points_mm
    assert whole.request.panel == FULL_SHAPE


def test_an_exact_surface_tells_how_far_off_its_preview_was(engine, card):
    assert engine.surface(ask(card.path, age=50.0)).preview_error_mm is None
    engine.prepare_previews(card.path)
    exact = engine.surface(ask(card.path, age=60.0))
    assert exact.preview_error_mm == pytest.approx(0.0, abs=1e-3)


def test_tables_are_read_from_the_disk_the_next_time(engine, card, atlas, tmp_path):
    engine.prepare_previews(card.path)
    again = Engine(lambda _: atlas, tmp_path / "cache")
    again.open(card.path)
    again.prepare_previews(card.path)
    assert tabulations(atlas) == 1


def test_tables_of_a_file_with_other_contents_are_made_anew(engine, card, atlas, tmp_path):
    engine.prepare_previews(card.path)
    card.path.write_bytes(b"trained on")
    again = Engine(lambda _: atlas, tmp_path / "cache")
    again.open(card.path)
    again.prepare_previews(card.path)
    assert tabulations(atlas) == 2


@pytest.mark.parametrize("damage", ["truncated", "no folder"])
def test_a_broken_cache_costs_time_and_no_more(engine, card, atlas, tmp_path, damage):
    if damage == "truncated":
        engine.prepare_previews(card.path)
        for file in (tmp_path / "cache").iterdir():
            file.write_bytes(file.read_bytes()[:40])
    else:
        (tmp_path / "cache").write_text("a file is in the way")
    atlas.calls.clear()
    again = Engine(lambda _: atlas, tmp_path / "cache")
    again.open(card.path)
    again.prepare_previews(card.path)
    assert tabulations(atlas) == 1
    assert again.has_previews(card.path)


def test_tabulating_can_be_cancelled_and_leaves_nothing(engine, card, tmp_path):
    engine.surface(ask(card.path, TEMPLATE))
    with pytest.raises(Cancelled):
        engine.prepare_previews(card.path, progress=UNWANTED)
    assert not engine.has_previews(card.path)
    assert not (tmp_path / "cache").exists()


class Loader:
    """Loads the stand-in and counts; ``meanwhile`` happens while it does."""

    def __init__(self, atlas, meanwhile=lambda: None) -> None:
        self.atlas, self.meanwhile, self.count = atlas, meanwhile, 0

    def __call__(self, path: Path):
        self.count += 1
        self.meanwhile()
        return self.atlas


def test_the_second_start_shows_the_template_without_the_networks(engine, card, atlas, tmp_path):
    first = engine.surface(ask(card.path, TEMPLATE))
    engine.prepare_previews(card.path)
    loader = Loader(atlas)
    again = Engine(loader, tmp_path / "cache")
    described = again.open(card.path)
    assert (described.path, described.name) == (card.path, card.name)
    assert described.covariates == card.covariates
    assert described.population.to_json() == card.population.to_json()
    for question in (
        ask(card.path, TEMPLATE),
        ask(card.path, Panel("effect", "age"), age=100.0),
        ask(card.path),
    ):
        shown = again.cached(question)
        assert shown is not None
        assert shown.is_exact
        for kept, made in [(shown.points_mm, first.points_mm), (shown.normals, first.normals)]:
            np.testing.assert_array_equal(kept, made, strict=True)
        np.testing.assert_array_equal(shown.faces, first.faces, strict=True)
        assert shown.extent == first.extent
    assert again.was_kept(card.path) and not engine.was_kept(card.path)
    assert loader.count == 0


def test_the_networks_are_loaded_once_and_when_they_are_needed(engine, card, atlas, tmp_path):
    engine.prepare_previews(card.path)
    loader = Loader(atlas)
    again = Engine(loader, tmp_path / "cache")
    again.open(card.path)
    moved = again.surface(ask(card.path, age=150.0))
    assert moved.extent == pytest.approx(atlas.volume_cm3(age=150.0), rel=0.01)
    again.prepare_previews(card.path)
    assert again.has_previews(card.path)
    assert loader.count == 1


def truncated(contents: bytes) -> bytes:
    return contents[: len(contents) // 2]


def flipped(contents: bytes) -> bytes:
    place = len(contents) // 3  # among the coordinates
    return contents[:place] + bytes([contents[place] ^ 1]) + contents[place + 1 :]


@pytest.mark.parametrize(
    "damaged", [truncated, flipped, lambda _: b"", lambda _: b"not an archive"], ids=["half", "bit", "0", "x"]
)
def test_a_damaged_opening_is_made_again(engine, card, atlas, tmp_path, damaged):
    engine.prepare_previews(card.path)
    (file,) = (tmp_path / "cache").glob(f"*.{cache.OPENING}")
    sound = file.read_bytes()
    file.write_bytes(damaged(sound))
    loader = Loader(atlas)
    again = Engine(loader, tmp_path / "cache")
    assert again.open(card.path).name == card.name
    assert loader.count == 1
    assert again.cached(ask(card.path, TEMPLATE)) is None
    again.prepare_previews(card.path)
    third = Engine(loader, tmp_path / "cache")
    third.open(card.path)
    assert third.was_kept(card.path)


@pytest.mark.parametrize("changed", ["file", "program"])
def test_nothing_old_is_shown_of_another_file_or_by_another_version(
    engine, card, atlas, tmp_path, monkeypatch, changed
):
    engine.prepare_previews(card.path)
    if changed == "file":
        card.path.write_bytes(b"trained on")
    else:
        monkeypatch.setattr(cache, "program_digest", lambda: b"newer")
    loader = Loader(atlas)
    again = Engine(loader, tmp_path / "cache")
    again.open(card.path)
    assert loader.count == 1
    assert again.cached(ask(card.path, TEMPLATE)) is None


def test_the_template_of_a_file_is_never_shown_with_the_networks_of_another(engine, card, atlas, tmp_path):
    engine.prepare_previews(card.path)
    again = Engine(Loader(atlas), tmp_path / "cache")
    again.open(card.path)
    card.path.write_bytes(b"trained on")
    with pytest.raises(InputError, match="open it again"):
        again.surface(ask(card.path, age=150.0))
    again.open(card.path)
    assert again.surface(ask(card.path, age=150.0)).is_exact


def test_a_file_that_is_replaced_while_it_is_read_is_read_again(atlas, atlas_file, tmp_path):
    contents = iter([b"trained on", b"trained on"])
    loader = Loader(atlas, lambda: atlas_file.write_bytes(next(contents)))
    first = Engine(loader, tmp_path / "cache")
    first.open(atlas_file)
    assert loader.count == 2
    first.prepare_previews(atlas_file)
    again = Engine(Loader(atlas), tmp_path / "cache")
    again.open(atlas_file)
    assert again.was_kept(atlas_file)


def test_the_cache_is_bounded(atlas, tmp_path):
    engine = Engine(Loader(atlas), tmp_path / "cache")
    for number in range(cache.KEPT_FILES + 2):
        path = tmp_path / f"{number}.safetensors"
        path.write_bytes(bytes([number]))
        engine.open(path)
        engine.prepare_previews(path)
    for ending in (cache.OPENING, cache.DISPLACEMENTS):
        assert len(list((tmp_path / "cache").glob(f"*.{ending}"))) == cache.KEPT_FILES
