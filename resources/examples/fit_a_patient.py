"""Fit a patient's scan, with part of the covariates unknown, and show the patient three years later.

The patient is a new child of the synthetic airway population, in a pose of the scanner's own, so that the
truth is known; put your own mesh, label volume or cloud of points in its place. ``naisr fit`` and ``naisr
transfer`` do the same on the command line. Files go into the folder named after the script, or into a
temporary one.
"""

import sys
import tempfile
from pathlib import Path

from naisr_model.atlas import Atlas
from naisr_model.data.populations import population
from naisr_model.patients.intake import take_in
from naisr_model.shipped import shipped_atlas

OUT = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="naisr-"))
SEED, CHILDREN = 5, 4

# %% Children that the atlas has never seen: another seed than that of its population.
airways = population("airway")
airways.write_population(OUT / "hospital", seed=SEED, patients=CHILDREN)
visit = min(airways.visits(SEED, CHILDREN), key=lambda one: abs(one.values["age"] - 90))
name = f"{visit.subject}_{visit.visit}"
print("the truth: " + ", ".join(f"{covariate} {value:.1f}" for covariate, value in visit.values.items()))
print(f"true volume: {airways.visit_shape(visit)[0].volume / 1000:.2f} cm³")

# %% Read the file, set right what is wrong with it, and move it onto the atlas by its landmarks.
atlas = Atlas.load(shipped_atlas())
known = {"age": visit.values["age"], "sex": visit.values["sex"]}
scan, landmarks = OUT / "hospital/meshes" / f"{name}.ply", OUT / "hospital/landmarks" / f"{name}.csv"
taken = take_in(scan, atlas, known, align="landmarks", landmarks=landmarks)
for sentence in taken.sentences:
    print(sentence)

# %% Fit. The weight is not told: it is inferred from the shape, with an interval.
fit = atlas.fit(taken.patient.mesh_mm, known)
low, high = fit.intervals["weight"]
print(f"weight: {fit.covariates['weight']:.1f} kg, 95 %: {low:.1f} to {high:.1f} kg")
low, high = fit.volume_interval_cm3
print(f"volume: {fit.volume_cm3:.2f} cm³, 95 %: {low:.2f} to {high:.2f} cm³")
print(f"mean distance of the scan to the fitted surface: {fit.residual_mm:.2f} mm, in {fit.seconds:.1f} s")
for sentence in fit.remarks:
    print(sentence)
fit.shape().export(OUT / "fitted.ply")

# %% Another day: only what is expected to last of this child is kept, so the interval is much wider.
later = fit.at({"age": known["age"] + 36, "weight": fit.covariates["weight"] + 9})
low, high = later.volume_interval_cm3
print(f"three years later: {later.volume_cm3:.2f} cm³, 95 %: {low:.2f} to {high:.2f} cm³")
print(f"there {fit.lasting:.0%} of what sets this child apart is kept")
later.shape().export(OUT / "later.ply")
print(f"surfaces are in {OUT}")
