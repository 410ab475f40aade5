"""Are norms right? The percentiles of people made for it have to be spread evenly from 0 to 100."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import Any

import igl
import numpy as np
from scipy.stats import kstest

from naisr_model.evaluation.held_out import aligned, known_norms, known_population, opened
from naisr_model.evaluation.studies.calibration import NewPatient, new_patients, visit_of
from naisr_model.learning.fitting.posterior import TWO_SIDED_95
from naisr_model.measures.curves import shapes_along
from naisr_model.measures.kinds import MEASURES, measured
from naisr_model.progress import SILENT, Progress
from naisr_model.work.journal import Record

SCAN = "volume of the scan"
"""What is told of the true shape itself; all else is of the fit."""


@dataclass(frozen=True)
class NormsStudy:
    """Ask whether norms hold, over new synthetic patients whose covariates are known.

    Attributes:
        atlas: the .safetensors file, of a synthetic population.
        patients: how many are made and fitted.
    """

    atlas: Path
    _: KW_ONLY
    patients: int = 200

    def cases(self) -> list[NewPatient]:
        """As in the calibration of intervals.

        Raises:
            InputError: when the atlas is not of a synthetic population, or nobody is asked for.
        """
        return new_patients(self.atlas, self.patients)

    def measure(self, case: NewPatient, progress: Progress = SILENT) -> Record:
        """How unusual every measure is, z, and the share of the surface within the population's 95 % band.

        Raises:
            Cancelled: when nobody waits any more.
        """
        atlas = opened(self.atlas)
        norms, visit = known_norms(atlas), visit_of(atlas, case, self.patients)
        mesh_mm, values = aligned(atlas, *known_population(atlas).visit_shape(visit)), dict(visit.values)
        fit = atlas.fit(mesh_mm, values, progress=progress)
        usual, own = (
            shapes_along(atlas, norms.gauge.fine, [values], person)[0] for person in (None, fit.individual)
        )
        found = norms.norms(values, measured(own)) | {
            SCAN: norms.norms(values, {"volume": mesh_mm.volume / 1000})["volume"]
        }
        points = np.asarray(usual.points_mm)
        away = igl.signed_distance(points, np.asarray(mesh_mm.vertices), np.asarray(mesh_mm.faces))[0]
        inside = np.abs(away) <= TWO_SIDED_95 * norms.local.sd_mm(atlas, points, values)
        return {"z": {name: norm.z for name, norm in found.items()}, "inside": float(inside.mean())}

    def summarise(self, records: Sequence[Record]) -> Record:
        """The report.

        Returns:
            ``n``, the mean share ``inside`` of the surface, and in ``rows`` for each measure the ``coverage``
            of the 95 % interval, the ``mean`` and the ``sd`` of z, and the Kolmogorov-Smirnov distance ``ks``
            of z from a standard normal number, with its ``p``.
        """
        names = list(records[0]["z"])
        rows = {name: _summary(np.array([record["z"][name] for record in records])) for name in names}
        return {"n": len(records), "inside": float(np.mean([r["inside"] for r in records])), "rows": rows}

    def markdown(self, report: Mapping[str, Any]) -> str:
        """The report as a table."""
        lines = [
            f"**{report['n']} new patients, covariates known**",
            "",
            "|  | inside the 95 % interval | mean of z | SD of z | Kolmogorov-Smirnov distance | p |",
            "| --- | ---: | ---: | ---: | ---: | ---: |",
        ]
        lines += [
            f"| {_title(name)} | {100 * row['coverage']:.1f} % | "
            f"{row['mean']:+.2f} | {row['sd']:.2f} | {row['ks']:.3f} | {row['p']:.2g} |"
            for name, row in report["rows"].items()
        ]
        return "\n".join(
            [*lines, "", f"Of the surface {100 * report['inside']:.1f} % lies inside the local 95 % band."]
        )


def _title(name: str) -> str:
    return MEASURES[name].title.lower() if name in MEASURES else name


def _summary(z: np.ndarray) -> dict[str, float]:
    test = kstest(z, "norm")
    return {
        "coverage": float((np.abs(z) <= TWO_SIDED_95).mean()),
        "mean": float(z.mean()),
        "sd": float(z.std()),
        "ks": float(test.statistic),
        "p": float(test.pvalue),
    }
