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
        label: the shape model, and what was known after a comma.
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

    @property
    def model(self) -> str:
        """Title of the shape model."""
        return self.label.partition(",")[0]


RECONSTRUCTION: Mapping[str, tuple[Published, ...]] = MappingProxyType(
    {
        "airway": (
            Published("NAISR, covariates given", (0.084, 0.044), (1.345, 1.190), (10.719, 8.577)),
            Published("NAISR, covariates inferred", (0.067, 0.039), (1.233, 1.132), (10.333, 8.404)),
            Published("A-SDF, covariates given", (0.852, 0.226), (4.090, 2.890), (30.848, 21.965)),
            Published("A-SDF, covariates inferred", (2.647, 1.178), (10.302, 9.068), (47.172, 37.835)),
            Published("DeepSDF", (0.077, 0.052), (1.401, 1.266), (10.765, 9.446)),
            Published("DIT", (0.094, 0.049), (1.414, 1.262), (11.524, 10.228)),
            Published("NDF", (0.238, 0.117), (2.174, 1.737), (14.950, 12.516)),
        ),
        "starman": (
            Published("NAISR, covariates given", (0.049, 0.036), None, (5.051, 4.666)),
            Published("NAISR, covariates inferred", (0.111, 0.072), None, (7.951, 7.141)),
        ),
    }
)
"""By name of the population: Jiao et al. (ICLR 2024), Table 2."""

RECONSTRUCTION_NOTES: Mapping[str, str] = MappingProxyType(
    {
        "airway": "NAISR (ICLR 2024), Table 2, real airways from CT, so other shapes than these; "
        "its EMD is as published and not comparable with an exact balanced one",
        "starman": "NAISR (ICLR 2024), Table 2, Starmen of another template and other deformations, which "
        "are not published; trained on 5,041 shapes",
    }
)
"""What has to be said of each."""

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
