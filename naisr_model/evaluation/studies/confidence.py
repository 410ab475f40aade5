"""Do the 95 % intervals of the population's shapes hold the truth? Asked where the truth is known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from naisr_model.atlas import Atlas
from naisr_model.errors import InputError
from naisr_model.evaluation.held_out import known_norms, known_population, opened
from naisr_model.evaluation.reports import markdown_table
from naisr_model.evaluation.truth import Place, beside_truth, truth_places
from naisr_model.measures.kinds import VOLUME
from naisr_model.progress import SILENT, Progress
from naisr_model.work.journal import Record

RESOLUTION = 128


@dataclass(frozen=True)
class KnownPlace:
    """A shape whose truth is known.

    Attributes:
        number: of the atlas, in the order they were given.
        row: what the place belongs to: ``growth path``, ``template`` or a covariate.
        place: in covariate space.
    """

    number: int
    row: str
    place: Place

    @property
    def key(self) -> str:
        """All that tells it from the others."""
        condition = f" {self.place.condition}" if self.place.condition else ""
        value = f"{self.place.values[self.place.covariate]:g}"
        return f"atlas {self.number}: {self.row} {self.place.covariate} {value}{condition}"


@dataclass(frozen=True)
class ConfidenceStudy:
    """Ask how often the true volume lies within the 95 % interval of the population's, z = 0.

    Attributes:
        atlases: the .safetensors files, of synthetic populations; the more seeds, the surer the answer.
    """

    atlases: tuple[Path, ...]

    def cases(self) -> list[KnownPlace]:
        """Every place of the truth of every atlas.

        Raises:
            InputError: when an atlas is not of a synthetic population in space, or none is given.
        """
        if not self.atlases:
            raise InputError("no atlas was given; give one or more")
        return [case for number, path in enumerate(self.atlases) for case in _places(number, opened(path))]

    def measure(self, case: KnownPlace, progress: Progress = SILENT) -> Record:
        """The volume, the true one and both ends of the interval, cm³.

        Raises:
            InputError: when the atlas has too few people to say how sure it is.
            Cancelled: when nobody waits any more.
        """
        atlas = opened(self.atlases[case.number])
        norms = known_norms(atlas)
        found = beside_truth(atlas, case.place, RESOLUTION, progress)
        low, high = norms.intervals(VOLUME.name, [case.place.values], found.volume_cm3)[:, 0]
        return {
            "row": case.row,
            "volume_cm3": found.volume_cm3,
            "truth_cm3": found.truth_cm3,
            "low_cm3": float(low),
            "high_cm3": float(high),
        }

    def summarise(self, records: Sequence[Record]) -> Record:
        """The report.

        Returns:
            ``atlases``, how many there are, and in ``rows``, by the growth path, each covariate and the
            template, of ``n`` places the share ``inside`` their interval, the mean ``half`` of the intervals
            and the ``largest`` error, both as shares of the volume.
        """
        names = dict.fromkeys(record["row"] for record in records)
        return {
            "atlases": len(self.atlases),
            "rows": {name: _summary([one for one in records if one["row"] == name]) for name in names},
        }

    def markdown(self, report: Mapping[str, Any]) -> str:
        """The report as a table."""
        header = ["", "places", "truth inside", "half of the interval", "largest error"]
        rows = [
            [
                name,
                str(row["n"]),
                f"{100 * row['inside']:.0f} %",
                f"{100 * row['half']:.1f} %",
                f"{100 * row['largest']:.1f} %",
            ]
            for name, row in report["rows"].items()
        ]
        count = f"{report['atlases']} atlas{'' if report['atlases'] == 1 else 'es'}"
        title = f"**True volumes and the 95 % intervals of the population's, {count}**"
        return f"{title}\n\n{markdown_table(header, rows)}"


def _places(number: int, atlas: Atlas) -> list[KnownPlace]:
    known_population(atlas)
    if atlas.frame.dim != 3:
        raise InputError("surfaces alone are measured so; give atlases of shapes in space")
    places = truth_places(atlas)
    return [
        *(KnownPlace(number, "growth path", place) for place in places["growth"]),
        *(KnownPlace(number, f"{place.covariate} alone", place) for place in places["effects"]),
        *(KnownPlace(number, "template", place) for place in places["template"]),
    ]


def _summary(records: Sequence[Record]) -> dict[str, float]:
    volume, truth, low, high = (
        np.array([record[f"{name}_cm3"] for record in records]) for name in ("volume", "truth", "low", "high")
    )
    return {
        "n": len(records),
        "inside": float(np.mean((low <= truth) & (truth <= high))),
        "half": float(np.mean((high - low) / volume)) / 2,
        "largest": float(np.abs(volume / truth - 1).max()),
    }
