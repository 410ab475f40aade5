"""From meshes and a CSV to an atlas: make some shapes, prepare them, train for some seconds, look.

The shapes are ellipsoids, so that everybody can tell what the atlas should find: age lengthens them, sex
widens them. What is here twenty lines of Python is for your own scans two commands, ``naisr prepare`` and
``naisr train``. Files go into the folder named after the script, or into a temporary one.
"""

import csv
import dataclasses
import math
import sys
import tempfile
from pathlib import Path

import trimesh

from naisr_model.atlas import Atlas
from naisr_model.config import SirenConfig
from naisr_model.data.prepare import PrepareOptions, prepare
from naisr_model.data.store import SampleStore
from naisr_model.learning.training.loop import train
from naisr_model.models.factory import preset
from naisr_model.models.naisr.network import NaisrConfig

OUT = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="naisr-"))
PEOPLE = 24


def half_axes_mm(age: float, sex: float) -> tuple[float, float, float]:
    """What the atlas is to find: 1 to 9 years lengthen, sex (-1 or +1) widens."""
    return 20.0 + 2.0 * sex, 20.0, 20.0 + 2.0 * age


def true_cm3(age: float, sex: float) -> float:
    """Volume of the ellipsoid."""
    return 4 / 3 * math.pi * math.prod(half_axes_mm(age, sex)) / 1000


# %% Meshes in millimetres, and a table that says who they are. Units stand in the header.
(OUT / "scans").mkdir(parents=True, exist_ok=True)
with (OUT / "eggs.csv").open("w", newline="", encoding="utf-8") as file:
    table = csv.writer(file)
    table.writerow(["mesh", "subject", "visit", "age [years]", "sex"])
    for number in range(PEOPLE):
        age, sex = 1 + 8 * number / (PEOPLE - 1), (-1, 1)[number % 2]
        mesh = trimesh.creation.icosphere(subdivisions=3)
        mesh.apply_scale(half_axes_mm(age, sex))
        mesh.export(OUT / "scans" / f"egg{number:02d}.stl")
        table.writerow([f"scans/egg{number:02d}.stl", f"S{number:02d}", 1, f"{age:.3f}", "FM"[number % 2]])

# %% Check, align and sample. A fifth of the subjects is held out for evaluation.
options = PrepareOptions(surface_samples=2000, near_samples=1500, uniform_samples=1000, workers=1)
report = prepare(OUT / "eggs.csv", OUT / "store", options=options)
print(f"{len(report.accepted)} shapes prepared, {len(report.rejected)} rejected")

# %% Train: the preset "demo" on networks small enough for simple shapes. It goes on where it was stopped.
demo = preset("demo")
small = dataclasses.replace(
    demo,
    network=NaisrConfig(
        latent=4,
        template=SirenConfig(width=32, hidden=1, omega0=5.0),
        displacement=SirenConfig(width=16, hidden=1, omega0=2.0),
    ),
    training=dataclasses.replace(
        demo.training, epochs=100, batch_shapes=10, template_rate=2e-3, displacement_rate=2e-3
    ),
)
checkpoint = train(SampleStore.open(OUT / "store"), small, OUT / "eggs.safetensors")
print(f"trained for {checkpoint.training['iterations']} iterations")

# %% Open what was made. `naisr-viewer eggs.safetensors` shows the same with sliders.
atlas = Atlas.load(OUT / "eggs.safetensors")
for years, level in ((2.0, -1.0), (5.0, 1.0), (8.0, 1.0)):
    found = atlas.shape({"age": years, "sex": level}, resolution=64).volume / 1000
    print(f"age {years:g}, sex {level:+g}: {found:.2f} cm³, true {true_cm3(years, level):.2f} cm³")
print(f"everything is in {OUT}")
