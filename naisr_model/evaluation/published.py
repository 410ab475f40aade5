"""What others have published on the same tasks, to stand beside what is measured; never the same shapes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

Pair = tuple[float, float]


@dataclass(frozen=True)
class Published:
    """Mean and median of a published result; None where nothing was published.

    Attributes:
        label: what was measured.
        cd_x100: Chamfer distance, x 100.
        emd_x100: as published, x 100; smaller than any exact balanced EMD of such shapes can be.
        hd_x100: Hausdorff distance, x 100.
        vd_cm3: volume difference in cubic centimetres.
    """

    label: str
    cd_x100: Pair | None = None
    emd_x100: Pair | None = None
    hd_x100: Pair | None = None
    vd_cm3: Pair | None = None


RECONSTRUCTION: Mapping[str, tuple[Published, ...]] = MappingProxyType(
    {
        "airway": (
            Published("NAISR, covariates given", (0.084, 0.044), (1.345, 1.190), (10.719, 8.577)),
            Published("NAISR, covariates inferred", (0.067, 0.039), (1.233, 1.132), (10.333, 8.404)),
        )
    }
)
"""By name of the population: NAISR (ICLR 2024), Table 2, paediatric airways segmented from CT."""

RECONSTRUCTION_NOTE = (
    "NAISR (ICLR 2024), Table 2, real airways from CT, so other shapes than these; "
    "its EMD is as published and not comparable with an exact balanced one"
)

TRANSFER: Mapping[str, tuple[Published, ...]] = MappingProxyType(
    {
        "airway": (
            Published("NAISR, covariates given", vd_cm3=(11.23, 9.65)),
            Published("NAISR, covariates inferred", vd_cm3=(12.82, 8.84)),
        )
    }
)
"""By name of the population: NAISR (ICLR 2024), Table 3, other visits of the patients of Table 2."""

TRANSFER_NOTE = "NAISR (ICLR 2024), Table 3, other visits of real patients, so other shapes than these"
