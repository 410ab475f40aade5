"""Explore an atlas: what is in it, what each covariate does by itself, and how shapes come in milliseconds.

Run it as it is, or cell by cell in an editor that knows ``# %%``. Surfaces are written into the folder that
is named after the script, or into a temporary one.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
import trimesh

from naisr_model.atlas import Atlas
from naisr_model.covariates import growth_path
from naisr_model.shipped import shipped_atlas
from naisr_model.surface.volume import enclosed_volume

OUT = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="naisr-"))
OUT.mkdir(parents=True, exist_ok=True)


def volume_cm3(mesh: trimesh.Trimesh) -> float:
    """Of the smooth surface; ``mesh.volume`` is that of the triangles alone, which is a little less."""
    return enclosed_volume(mesh.vertices, mesh.vertex_normals, mesh.faces) / 1000


# %% What is in it: an atlas file says everything about itself.
atlas = Atlas.load(shipped_atlas())
training = int((~atlas.population.held_out).sum())
print(f"{atlas.name}: {training} training shapes of {len(atlas.population)}")
for covariate in atlas.covariates:
    low, high = map(covariate.format, covariate.range)
    print(f"  {covariate.name}: {low} to {high}, centre {covariate.format(covariate.centre)}")

# %% The template, and what age alone does to it. A covariate that is not named is at the population centre.
template = atlas.template()
print(f"template: {volume_cm3(template):.2f} cm³, {len(template.vertices)} vertices")
for months in (24, 120, 200):
    print(f"age only, {months} months: {volume_cm3(atlas.effect('age', months, resolution=64)):.2f} cm³")

# %% Age and weight go together: the growth path is the mean of the others at each age.
ages = np.array([60.0, 90.0, 117.0, 170.0, 220.0])
for values in growth_path(atlas.population, "age", ages):
    child = dict(zip(atlas.population.names, map(float, values), strict=True)) | {"sex": 1.0}
    shape = atlas.shape(child, resolution=80)
    shape.export(OUT / f"boy_{child['age']:.0f}_months.ply")
    print(f"boy of {child['age']:.0f} months and {child['weight']:.1f} kg: {volume_cm3(shape):.2f} cm³")

# %% Signed distances in millimetres, negative inside; on the surface they are 0.
distances_mm = atlas.sdf(template.vertices[::50], {})
print(f"largest distance of the template's vertices from its surface: {np.abs(distances_mm).max():.3f} mm")

# %% Many shapes: tabulate once, then carry the template's vertices to any covariates in milliseconds.
tracker = atlas.tracker(template, atlas.tabulate(template))
grown = tracker.track({"age": 160})
moved_mm = np.linalg.norm(grown.points_mm - template.vertices, axis=1)
away_mm = np.abs(atlas.sdf(grown.points_mm, {"age": 160}))
print(f"from the centre to 160 months the surface moves {moved_mm.mean():.2f} mm on average")
print(f"99 % of the carried vertices are within {np.quantile(away_mm, 0.99):.3f} mm of the exact surface")
print(f"surfaces are in {OUT}")
