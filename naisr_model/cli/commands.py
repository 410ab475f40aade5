"""The commands of ``naisr``: argument parsing only; each calls one function of the library."""

from __future__ import annotations

from cyclopts import App, Parameter

from naisr_model import __version__
from naisr_model.cli import atlases, benchmarking, cohorts, data, patients
from naisr_model.cli.options import converted

COMMANDS = (
    *(data.populate, data.prepare),
    *(patients.fit, patients.transfer, patients.evolve, patients.measure),
    *(atlases.info, atlases.mesh, benchmarking.bench),
)

TRAINING = """Train an atlas; stop it whenever you like, the same command goes on.

OUT can be opened from the first minute on; OUT.training/ beside it keeps the state to resume from, a
TensorBoard log and the template at chosen epochs.
"""

app = App(
    name="naisr",
    version=__version__,
    help="Shape atlases that explain: prepare data, train, inspect, evaluate and export.",
    default_parameter=Parameter(negative=(), converter=converted),
)
for _command in COMMANDS:
    app.command(_command)
app.command(cohorts.cohort)
# What these offer comes from the models and the studies, which load torch; so only when they are asked for.
app.command(
    "naisr_model.cli.training:train",
    name="train",
    help=TRAINING,
)
app.command("naisr_model.cli.evaluating:evaluate", name="evaluate", help="Measure how good an atlas is.")
