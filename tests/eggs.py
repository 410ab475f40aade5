"""A population whose effects are known in closed form: ellipsoids that grow with age and widen with sex."""

from __future__ import annotations

import dataclasses

import trimesh

from naisr_model.config import Preset, SirenConfig
from naisr_model.models.deepsdf import DeepSdfConfig
from naisr_model.models.factory import preset
from naisr_model.models.naisr.network import NaisrConfig


def egg(age: float, sex: float) -> trimesh.Trimesh:
    """An ellipsoid in millimetres: age (1 to 9) lengthens it, sex (-1, +1) widens it."""
    mesh = trimesh.creation.icosphere(subdivisions=3)
    mesh.apply_scale([20 + 2 * sex, 20, 20 + 2 * age])
    return mesh


def egg_preset(epochs: int) -> Preset:
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
    )
    return Preset("naisr", network, training)


def egg_deepsdf_preset(epochs: int) -> Preset:
    """The same for DeepSDF, whose codes have age and sex to tell."""
    network = DeepSdfConfig(latent=4, shape=SirenConfig(32, 1, omega0=5.0))
    training = dataclasses.replace(
        preset("deepsdf-demo").training,
        epochs=epochs,
        batch_shapes=10,
        template_rate=2e-3,
        latent_rate=1e-2,
    )
    return Preset("deepsdf", network, training)
