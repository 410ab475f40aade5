"""Held-out shapes from a store and from a seed."""

from __future__ import annotations

import dataclasses
import shutil

import numpy as np
import pytest
from eggs import egg

from naisr_model.atlas import Atlas
from naisr_model.checkpoint import load, save
from naisr_model.data.prepare import PrepareOptions, prepare
from naisr_model.errors import InputError
from naisr_model.evaluation.held_out import held_out, held_out_rows, opened, require_shapes


def test_rows_are_those_that_were_held_out(egg_atlas):
    atlas = Atlas.load(egg_atlas)
    rows = held_out_rows(atlas)
    assert rows == np.flatnonzero(atlas.population.held_out).tolist()
    assert held_out_rows(atlas, 2) == rows[:2]
    assert held_out_rows(atlas, subjects=[atlas.population.subjects[rows[1]]]) == rows[1:2]


def test_a_store_gives_the_shapes_that_were_prepared(egg_atlas, egg_store):
    atlas = Atlas.load(egg_atlas)
    require_shapes(atlas, egg_store.path)
    for row in held_out_rows(atlas, 2):
        shape = held_out(atlas, egg_store.path, row)
        assert shape.subject == atlas.population.subjects[row] and shape.values == atlas.population.row(row)
        true = egg(shape.values["age"], shape.values["sex"])
        assert shape.mesh_mm.volume == pytest.approx(true.volume, rel=1e-3)


def test_a_population_gives_its_shapes_again(egg_people):
    atlas = opened(egg_people.atlas)
    require_shapes(atlas, None)
    row = held_out_rows(atlas)[0]
    shape = held_out(atlas, None, row)
    true = egg(shape.values["age"], shape.values["sex"])
    assert shape.mesh_mm.volume == pytest.approx(egg_people.larger**3 * true.volume)
    assert shape.values == atlas.population.row(row)


def test_another_file_at_the_same_place_is_another_atlas(egg_atlas, tmp_path):
    path = shutil.copy(egg_atlas, tmp_path / "a.safetensors")
    first = opened(path)
    assert opened(path) is first
    save(path, dataclasses.replace(load(egg_atlas), name="other"))
    assert opened(path).name == "other"


def test_what_is_missing_is_said(egg_atlas, egg_table, tmp_path):
    atlas = Atlas.load(egg_atlas)
    with pytest.raises(InputError, match="give the store it was trained on with --store"):
        require_shapes(atlas, None)
    with pytest.raises(InputError, match="--limit is -1; give 0 or more"):
        require_shapes(atlas, None, -1)
    prepare(egg_table, tmp_path / "all", options=PrepareOptions(500, 500, 500, held_out=0, workers=1))
    with pytest.raises(InputError, match="not the store that this atlas was trained on: other covariates"):
        require_shapes(atlas, tmp_path / "all")
    everybody = load(egg_atlas).population
    nobody = dataclasses.replace(everybody, held_out=np.zeros(len(everybody), dtype=bool))
    with pytest.raises(InputError, match="no shape was held out"):
        require_shapes(Atlas(dataclasses.replace(load(egg_atlas), population=nobody)), None)
