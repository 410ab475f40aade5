"""Drawing random subsets from a store on disk."""

from __future__ import annotations

import json
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest
import trimesh

from naisr_model.covariates import Covariate, Population
from naisr_model.data.align import Alignment
from naisr_model.data.store import Draw, SampleStore, is_whole, write_index
from naisr_model.errors import InputError
from naisr_model.frames import Frame

COUNTS = {"surface": (50, 6), "near": (80, 4), "uniform": (30, 4)}


@pytest.fixture
def store(tmp_path) -> SampleStore:
    """Three shapes whose samples carry their own address: row, kind, line."""
    for row in range(3):
        folder = tmp_path / "shapes" / f"shape{row}"
        folder.mkdir(parents=True)
        for k, (kind, (lines, columns)) in enumerate(COUNTS.items()):
            address = 1000 * row + 100 * k + np.arange(lines)[:, None] + np.zeros(columns)
            np.save(folder / f"{kind}.npy", address.astype(np.float32))
        trimesh.creation.icosphere(1, radius=1.0 + row).export(folder / "mesh.ply")
    age = Covariate("age", "months", "continuous", 2.0, 1.0, (1.0, 3.0))
    population = Population((age,), tuple("abc"), ("1",) * 3, np.arange(3.0)[:, None], np.zeros(3, bool))
    write_index(
        tmp_path,
        name="test",
        population=population,
        frame=Frame((1.0, 2.0, 3.0), 40.0),
        alignment=Alignment("landmarks", "cords", {"cords": (0.0, 0.0, 0.0)}),
        source={"population": "airway", "seed": 0},
        options={"seed": 0},
        folders=[f"shape{row}" for row in range(3)],
    )
    return SampleStore.open(tmp_path)


def drawn(path: Path, seed: int) -> Draw:
    return SampleStore.open(path).draw([0, 1, 2], 10, 20, 5, np.random.default_rng(seed))


def test_what_was_written_is_read(store):
    assert (store.name, len(store), store.source["population"]) == ("test", 3, "airway")
    assert store.frame == Frame((1.0, 2.0, 3.0), 40.0)
    assert store.alignment.reference == {"cords": (0.0, 0.0, 0.0)}
    assert store.population.names == ("age",)
    assert store.mesh(2).bounds[1].max() == pytest.approx(3.0)


def test_a_draw_has_the_asked_shapes_of_the_asked_rows(store):
    draw = store.draw([2, 0], 10, 20, 5, np.random.default_rng(0))
    assert draw.surface_points.shape == draw.surface_normals.shape == (2, 10, 3)
    assert draw.space_points.shape == (2, 25, 3)
    assert draw.space_sdf.shape == (2, 25)
    assert {a.dtype for a in draw} == {np.dtype(np.float32)}
    for i, row in enumerate((2, 0)):
        assert set(draw.surface_points[i].ravel() // 100) == {10 * row}
        assert set(draw.space_sdf[i, :20] // 100) == {10 * row + 1}
        assert set(draw.space_sdf[i, 20:] // 100) == {10 * row + 2}
    assert len(np.unique(draw.space_sdf)) == 50


def test_only_the_generator_decides_what_is_drawn(store):
    first, again, other = drawn(store.path, 1), drawn(store.path, 1), drawn(store.path, 2)
    np.testing.assert_array_equal(first.space_sdf, again.space_sdf)
    assert not np.array_equal(first.space_sdf, other.space_sdf)


def test_every_sample_is_drawn_sooner_or_later(store):
    rng = np.random.default_rng(0)
    seen = {float(v) for _ in range(400) for v in store.draw([0], 10, 20, 5, rng).space_sdf.ravel()}
    assert len(seen) == 110
    everything = store.draw([1], 50, 80, 30, rng)
    assert len(np.unique(everything.space_sdf)) == 110


def test_several_processes_read_the_same_store(store):
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        draws = list(
            pool.map(
                store.draw, [[0, 1]] * 4, [10] * 4, [20] * 4, [5] * 4, map(np.random.default_rng, range(4))
            )
        )
    for seed, draw in enumerate(draws):
        here = store.draw([0, 1], 10, 20, 5, np.random.default_rng(seed))
        np.testing.assert_array_equal(draw.space_points, here.space_points)


def test_asking_for_too_much_is_explained(store):
    with pytest.raises(InputError, match="81 near samples were asked for but the store has 80"):
        store.draw([0], 10, 81, 5, np.random.default_rng(0))


def test_what_is_no_store_is_explained(store, tmp_path):
    with pytest.raises(InputError, match="not a finished sample store"):
        SampleStore.open(tmp_path / "elsewhere")
    index = store.path / "store.json"
    record = json.loads(index.read_text())
    index.write_text(json.dumps(record | {"version": 99}))
    with pytest.raises(InputError, match="newer version"):
        SampleStore.open(store.path)
    index.write_text(index.read_text()[:40])
    with pytest.raises(InputError, match="damaged"):
        SampleStore.open(store.path)


@pytest.mark.parametrize(
    "change",
    [
        lambda record: {"version": 1},
        lambda record: record | {"population": []},
        lambda record: record | {"frame": {"centre_mm": "here"}},
        lambda record: record | {"source": 3},
        lambda record: record | {"shapes": record["shapes"][:2]},
    ],
)
def test_a_damaged_index_is_explained(store, change):
    index = store.path / "store.json"
    index.write_text(json.dumps(change(json.loads(index.read_text()))))
    with pytest.raises(InputError, match=r"is damaged .*; run 'naisr prepare' again"):
        SampleStore.open(store.path)


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:300])


def of_doubles(path: Path) -> None:
    np.save(path, np.load(path).astype(np.float64))


def of_one_column(path: Path) -> None:
    np.save(path, np.load(path)[:, 0])


@pytest.mark.parametrize("damage", [Path.unlink, cut, of_doubles, of_one_column])
def test_damaged_samples_are_explained(store, damage):
    damage(store.folder(1) / "near.npy")
    with pytest.raises(InputError, match=r"near\.npy is damaged .*; run 'naisr prepare' again"):
        store.draw([0, 1, 2], 10, 20, 5, np.random.default_rng(0))


@pytest.mark.parametrize("damage", [Path.unlink, cut])
def test_samples_that_are_damaged_during_a_training_are_explained(store, damage):
    store.draw([1], 10, 80, 5, np.random.default_rng(0))
    damage(store.folder(1) / "near.npy")
    with pytest.raises(InputError, match=r"near\.npy is damaged"):
        store.draw([1], 10, 80, 5, np.random.default_rng(0))


@pytest.mark.parametrize("damage", [Path.unlink, cut])
def test_a_damaged_mesh_is_explained(store, damage):
    damage(store.folder(1) / "mesh.ply")
    with pytest.raises(InputError, match=r"mesh\.ply is damaged"):
        store.mesh(1)


@pytest.mark.parametrize(
    ("where", "value", "reason"),
    [
        ("shapes", ["shape0", "shape1"], "2 shapes of 3 visits"),
        ("shapes", ["shape0", "../shape1", "shape2"], "'../shape1' of a shape is none of the store"),
        ("shapes", ["shape0", "/", "shape2"], "is none of the store"),
        ("shapes", [1, 2, 3], "not a text"),
        ("version", "abc", "not a whole number"),
        ("version", 0, "unknown version 0"),
        ("name", 7, "not a text"),
        ("options", {"surface_samples": "many"}, "not a whole number"),
        ("options", {"near_samples": 0}, "'near_samples' is below 1"),
        ("source", {"population": []}, "not a finite number"),
        ("frame", {"centre_mm": [0, 0, 0], "scale_mm": 0}, "a frame of 0 mm a unit"),
        ("population.subjects", ["a", "a", "a"], "'a', visit '1' is there twice"),
        ("population.held_out", [True, True, True], "no shape is left"),
        ("population.values", [[0], [1], [float("nan")]], "no finite number"),
        ("population.values", [[0, 1, 2]], "1 by 3 numbers where 3 by 1"),
    ],
)
def test_an_index_that_contradicts_itself_is_explained(store, where, value, reason):
    index = store.path / "store.json"
    record = json.loads(index.read_text())
    *outer, last = where.split(".")
    place = record
    for step in outer:
        place = place[step]
    place[last] = value
    index.write_text(json.dumps(record))
    with pytest.raises(InputError, match=f"store.json is damaged .*{reason}.*; run 'naisr prepare' again"):
        SampleStore.open(store.path)


@pytest.mark.parametrize("text", ["[" * 100_000, "[]", "3", ""])
def test_an_index_that_is_none_is_explained(store, text):
    (store.path / "store.json").write_text(text)
    with pytest.raises(InputError, match=r"store\.json is damaged"):
        SampleStore.open(store.path)


def test_arrays_that_are_shorter_than_the_index_says_are_explained(store):
    index = store.path / "store.json"
    record = json.loads(index.read_text())
    index.write_text(json.dumps(record | {"options": {"near_samples": 90}}))
    with pytest.raises(InputError, match=r"near\.npy is damaged \(80 samples where 90 are expected\)"):
        drawn(store.path, 0)


@pytest.mark.parametrize("wrong", [np.nan, np.inf, 1e30])
def test_samples_that_are_no_numbers_are_explained_and_made_again(store, wrong):
    folder = store.path / "shapes" / "shape1"
    counts = {kind: lines for kind, (lines, _) in COUNTS.items()}
    assert is_whole(folder, counts, 3)
    samples = np.load(folder / "uniform.npy")
    samples[:, 1] = wrong
    np.save(folder / "uniform.npy", samples)
    with pytest.raises(InputError, match=r"uniform\.npy is damaged \(it holds what is no number"):
        drawn(store.path, 0)
    assert not is_whole(folder, counts, 3)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (np.zeros(12, np.float32), "1 dimensions in place of rows and columns"),
        (np.zeros((2, 3, 4), np.float32), "3 dimensions in place of rows and columns"),
        (np.zeros((60, 6), np.float64), "float64 in 6 columns"),
        (b"\x93NUMPY\x01\x00\x14\x00{'descr': ('<f4', \n\n", "its header is not that of samples"),
        (b"\x93NUMPY\x01\x00\x14\x00{'shape': range    }\n", "its header is not that of samples"),
        (b"no samples", "its header is not that of samples"),
    ],
)
def test_files_that_are_no_samples_are_explained_before_any_is_drawn(store, content, said):
    path = store.path / "shapes" / "shape1" / "surface.npy"
    if isinstance(content, bytes):
        path.write_bytes(content)
    else:
        np.save(path, content)
    opened = SampleStore.open(store.path)
    row = opened.folders.index("shape1")
    with pytest.raises(InputError, match=rf"surface\.npy is damaged \(.*{said}\); run 'naisr prepare' again"):
        opened.require_sound(row, 1, 1, 1)


def test_one_sample_of_many_that_is_no_number_is_found_before_any_is_drawn(store):
    path = store.path / "shapes" / "shape1" / "near.npy"
    samples = np.load(path)
    samples[-1, -1] = np.nan
    np.save(path, samples)
    opened = SampleStore.open(store.path)
    opened.require_sound(1 - opened.folders.index("shape1"), 1, 1, 1)
    with pytest.raises(InputError, match=r"near\.npy is damaged \(it holds what is no number"):
        opened.require_sound(opened.folders.index("shape1"), 1, 1, 1)


def test_more_samples_than_there_are_are_refused_before_any_is_drawn(store):
    with pytest.raises(InputError, match="81 near samples were asked for but the store has 80"):
        SampleStore.open(store.path).require_sound(0, 1, 81, 1)
