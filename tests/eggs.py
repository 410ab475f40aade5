"""A population whose effects are known in closed form: ellipsoids that grow with age and widen with sex."""

from __future__ import annotations

import dataclasses
from functools import partial
from pathlib import Path
from typing import Any

import nibabel
import nrrd
import numpy as np
import torch
import trimesh
from numpy.typing import ArrayLike, NDArray

from naisr_model.checkpoint import Checkpoint, load
from naisr_model.config import Preset, SirenConfig
from naisr_model.covariates import Covariate, Population
from naisr_model.data.align import Alignment
from naisr_model.frames import Frame
from naisr_model.models.factory import build, preset
from naisr_model.models.naisr.network import NaisrConfig
from naisr_model.models.single import SingleConfig
from naisr_model.shapes.curve import Curve, closed

RAS = np.diag([-1.0, -1.0, 1.0, 1.0])
"""LPS to RAS and back."""


def egg(age: float, sex: float) -> trimesh.Trimesh:
    """An ellipsoid in millimetres: age (1 to 9) lengthens it, sex (-1, +1) widens it."""
    mesh = trimesh.creation.icosphere(subdivisions=3)
    mesh.apply_scale([20 + 2 * sex, 20, 20 + 2 * age])
    return mesh


def ellipse(age: float) -> Curve:
    """20 mm wide; age, 1 to 9, makes it taller. Its area is pi 10 (10 + age) mm²."""
    angles = np.linspace(0, 2 * np.pi, 120, endpoint=False)
    return closed([np.stack([10 * np.cos(angles), (10 + age) * np.sin(angles)], axis=1)])


def egg_preset(epochs: int, hidden_rate: float = 0.0) -> Preset:
    """The demo recipe on networks small enough for a test."""
    network = NaisrConfig(
        latent=4, template=SirenConfig(32, 1, omega0=5.0), displacement=SirenConfig(16, 1, omega0=2.0)
    )
    training = dataclasses.replace(
        preset("demo").training,
        epochs=epochs,
        batch_shapes=10,
        surface_points=64,
        near_points=32,
        uniform_points=32,
        template_rate=2e-3,
        displacement_rate=2e-3,
        hidden_rate=hidden_rate,
    )
    return Preset("naisr", network, training)


def ellipse_preset() -> Preset:
    """The recipe for the plane on networks small enough for a test."""
    training = dataclasses.replace(
        preset("starman-demo").training,
        epochs=250,
        batch_shapes=8,
        template_rate=2e-3,
        displacement_rate=2e-3,
        template_epochs=(1,),
    )
    small = NaisrConfig(
        dim=2, latent=2, template=SirenConfig(32, 1, omega0=5.0), displacement=SirenConfig(16, 1, omega0=2.0)
    )
    return Preset("naisr", small, training)


def egg_joint_preset(epochs: int) -> Preset:
    """The same for one displacement of all covariates."""
    plain, training = egg_preset(epochs), preset("joint-demo").training
    kept = dataclasses.replace(plain.training, population_share=0.0, loss=training.loss)
    return Preset("joint", plain.network, kept)


def egg_single_preset(model: str, epochs: int) -> Preset:
    """The same for one of the models of a single network."""
    network = SingleConfig(latent=4, shape=SirenConfig(32, 1, omega0=5.0))
    training = dataclasses.replace(
        preset(f"{model}-demo").training,
        epochs=epochs,
        batch_shapes=10,
        template_rate=2e-3,
        latent_rate=1e-2,
        hidden_rate=0.0,
    )
    return Preset(model, network, training)


def egg_warping_preset(model: str, epochs: int) -> Preset:
    """The same for a model that deforms a template in a way of its own."""
    plain, given = egg_preset(epochs), preset(f"{model}-demo")
    moving = {"dit": "warp_width", "ndf": "velocity", "invertible": "displacement"}[model]
    sizes: dict[str, Any] = {
        "latent": 4,
        "template": SirenConfig(32, 1, omega0=5.0),
        moving: 24 if model == "dit" else SirenConfig(16, 1, omega0=2.0),
    }
    of_codes = given.training.residual_latents
    training = dataclasses.replace(
        plain.training,
        population_share=given.training.population_share,
        residual_latents=of_codes,
        latent_rate=plain.training.latent_rate if of_codes else 1e-2,
        loss=given.training.loss,
    )
    return Preset(model, dataclasses.replace(given.network, **sizes), training)


egg_deepsdf_preset = partial(egg_single_preset, "deepsdf")
egg_asdf_preset = partial(egg_single_preset, "asdf")


def moved_as_in(model: str, atlas: Path) -> Checkpoint:
    """The eggs' atlas of NAISR with its template, and points moved in another model's way.

    What moves them is NAISR's own networks where there are covariates; else it is random, as are the codes.
    """
    known = load(atlas)
    preset = egg_warping_preset(model, 1)
    with torch.random.fork_rng():
        torch.manual_seed(0)
        weights = build(preset, len(known.population.covariates)).state_dict()
        codes = torch.randn(known.latents.shape).numpy()
    own = {
        name.replace("displacement_networks", "velocity_networks"): one for name, one in known.weights.items()
    }
    weights |= {name: own[name] for name in set(weights) & set(own)}
    last = [name for name in weights if name.endswith("last_weight") and name not in own]
    weights |= {name: 10 * weights[name] for name in last}
    latents = known.latents if model == "invertible" else codes
    return dataclasses.replace(known, preset=preset, weights=weights, latents=latents)


def saved(mesh: trimesh.Trimesh, path: Path, matrix: ArrayLike | None = None) -> Path:
    """A mesh as a file, moved by a 4x4 matrix."""
    mesh = mesh.copy() if matrix is None else mesh.copy().apply_transform(matrix)
    mesh.export(path)
    return path


def turned(degrees: float, shift_mm: ArrayLike) -> NDArray[np.float64]:
    """The 4x4 matrix of a turn about x and a shift."""
    matrix = np.asarray(trimesh.transformations.rotation_matrix(np.radians(degrees), [1.0, 0.0, 0.0]))
    matrix[:3, 3] = shift_mm
    return matrix


def label_volume(path: Path) -> Path:
    """Label 1 a small block, label 2 the egg, in voxels of 1 mm; NRRD can name it."""
    x, y, z = np.mgrid[-30:31, -30:31, -45:46]
    half_mm = np.abs(egg(6.0, 1.0).bounds[0])
    inside = (x / half_mm[0]) ** 2 + (y / half_mm[1]) ** 2 + (z / half_mm[2]) ** 2 < 1
    labels = 2 * inside.astype(np.uint8)
    labels[:4, :4, :4] = 1
    origin = np.array([-30.0, -30.0, -45.0])
    if path.suffix == ".nrrd":
        space = {"space": "LPS", "space directions": np.eye(3), "space origin": origin}
        nrrd.write(str(path), labels, space | {"Segment0_LabelValue": "2", "Segment0_Name": "egg"})
    else:
        nibabel.Nifti1Image(labels, RAS @ trimesh.transformations.translation_matrix(origin)).to_filename(
            path
        )
    return path


def untrained(model: str = "naisr") -> Checkpoint:
    """An atlas of six eggs with networks as they were drawn: a small good file to make a bad one of."""
    age = Covariate("age", "years", "continuous", 5.0, 2.5, (1.0, 9.0))
    sex = Covariate("sex", "", "binary", 0.0, 1.0, (-1.0, 1.0), ("F", "M"))
    values = np.array([[1.0, -1], [3, 1], [5, -1], [7, 1], [9, -1], [4, 1]])
    held_out = np.arange(6) == 5
    population = Population((age, sex), tuple("abcdef"), ("1",) * 6, values, held_out)
    deforming = {"naisr": egg_preset, "joint": egg_joint_preset}
    chosen = deforming[model](1) if model in deforming else egg_single_preset(model, 1)
    with torch.random.fork_rng():
        torch.manual_seed(0)
        weights = build(chosen, 2).state_dict()
    return Checkpoint(
        name="eggs",
        preset=chosen,
        weights=weights,
        latents=np.zeros((5, chosen.network.latent), np.float32),
        population=population,
        frame=Frame((0.0, 0.0, 0.0), 40.0),
        alignment=Alignment(),
        source={},
        training={"iterations": 3, "seconds": 1.0},
    )
