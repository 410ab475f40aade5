"""The good inputs, made small: an atlas of eggs, and a table, a store and a training of a few of them."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

from corpus import tables
from corpus.case import Goods, place
from corpus.runner import contents

from naisr_model import checkpoint
from naisr_model.cli import main
from naisr_model.data.align import Alignment

SETTINGS = """[network]
latent = 2
template = {width = 8, hidden = 1, omega0 = 5.0}
displacement = {width = 8, hidden = 1, omega0 = 2.0}
[training]
batch_shapes = 4
surface_points = 16
near_points = 8
uniform_points = 8
"""
"""Of a training that takes no time."""


def made(atlas: Path, folder: Path) -> Goods:
    """Make the good inputs in a folder from a trained atlas of eggs."""
    shutil.copyfile(atlas, folder / "atlas.safetensors")
    loaded = checkpoint.load(atlas)
    marked = replace(loaded, alignment=Alignment("landmarks", "", tables.landmarks(6.0, 1.0)))
    checkpoint.save(folder / "marked.safetensors", marked)
    (folder / "small.toml").write_text(SETTINGS)
    place(tables.good(), folder / "table")
    store, out = folder / "store", folder / "training" / "mine.safetensors"
    _done("prepare", folder / "table" / "table.csv", "--out", store, *tables.FEW)
    _done("train", store, "--out", out, "--config", folder / "small.toml", "--epochs", 1)
    return Goods(folder, tables.good(), contents(store), contents(folder / "training"))


def _done(*words: object) -> None:
    assert main([str(word) for word in words]) == 0
