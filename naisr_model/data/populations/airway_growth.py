"""Deterministic growth of the synthetic paediatric airway: ages in months, weights in kilograms.

Sizes are multiplicatively separable in age and weight, so that each covariate has an effect of
its own: ``length = F_L(age) G_L(weight)`` and ``calibre = F_C(age) G_C(weight)``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

MIN_AGE_MONTHS, MAX_AGE_MONTHS = 1.0, 233.0

_CHART_MONTHS = (0, 1, 3, 6, 12, 24, 36, 48, 60, 84, 108, 120, 144, 168, 180, 192, 216, 240)
# Rounded medians in the manner of the usual infant and child growth charts; adolescents are somewhat
# heavier than the charts, as hospital cohorts are.
_BOYS_KG = (3.4, 4.2, 6.2, 7.9, 9.8, 12.6, 14.6, 16.5, 18.5, 23.2, 29.5, 33.5, 43.5, 54.5, 60, 64.5, 69.5, 72)
_GIRLS_KG = (3.3, 4.0, 5.8, 7.3, 9.2, 12, 14.1, 16.1, 18.1, 23, 29.5, 34, 43.5, 51.5, 54.5, 56.5, 59, 60.5)
_HEIGHT_CM = (
    50,
    54,
    60.5,
    67,
    75,
    87,
    95.5,
    102.5,
    109,
    121.5,
    133,
    138,
    150.5,
    161,
    164.5,
    167,
    169.5,
    170.5,
)

# Body height triples from birth to adulthood, the airway grows in length about 2.4 times.
_LENGTH_PER_HEIGHT = 0.75

LENGTH_PER_WEIGHT = 0.02
NASAL_CALIBRE_PER_WEIGHT = 0.06
CALIBRE_PER_WEIGHT = 0.145

_LARYNX_SEX_SHARE = 0.08
_PUBERTY_MONTHS = (130.0, 170.0)


@dataclass(frozen=True)
class Sizes:
    """How large an airway is against the adult reference, all without unit.

    Attributes:
        length: scale of the centrelines.
        calibre: scale of the sections of pharynx, larynx and trachea.
        nasal_calibre: scale of the sections of the two nasal passages.
        larynx: further factor on the sections near the vocal cords.
    """

    length: float
    calibre: float
    nasal_calibre: float
    larynx: float


def smooth_step(value: ArrayLike, low: float, high: float) -> NDArray[np.float64]:
    """0 below ``low``, 1 above ``high``, twice continuously differentiable between them."""
    t = np.clip((np.asarray(value, dtype=np.float64) - low) / (high - low), 0.0, 1.0)
    return t**3 * (10.0 - 15.0 * t + 6.0 * t**2)


def _chart(values: tuple[float, ...]) -> CubicSpline:
    # Early growth is about proportional to the square root of age, which spreads the knots evenly.
    return CubicSpline(np.sqrt(_CHART_MONTHS), np.log(values))


_BOYS, _GIRLS, _HEIGHT = _chart(_BOYS_KG), _chart(_GIRLS_KG), _chart(_HEIGHT_CM)


def _read_chart(chart: CubicSpline, age_months: float) -> float:
    return float(chart(np.sqrt(np.clip(age_months, _CHART_MONTHS[0], _CHART_MONTHS[-1]))))


def median_weight_kg(age_months: float, sex: float = 0.0) -> float:
    """The population growth path: the usual weight at an age.

    Args:
        age_months: 0 to 240, clamped outside.
        sex: -1 for girls, +1 for boys; geometric interpolation between the two.
    """
    boys, girls = _read_chart(_BOYS, age_months), _read_chart(_GIRLS, age_months)
    return float(np.exp((1 + sex) / 2 * boys + (1 - sex) / 2 * girls))


def path_volume_cm3(age_months: float) -> float:
    """Airway volume along the growth path, fitted to the published percentile table.

    Rapid growth in infancy, steady growth in childhood and a pubertal spurt.
    """
    infancy = 3.5 + 8.4 * (1 - np.exp(-age_months / 12.0))
    spurt = 40.0 / (1 + np.exp(-(age_months - 160.0) / 25.0))
    return float(infancy + 0.24 * age_months + spurt)


def _relative_length(age_months: float) -> float:
    height = _read_chart(_HEIGHT, age_months) - _read_chart(_HEIGHT, MAX_AGE_MONTHS)
    return float(np.exp(_LENGTH_PER_HEIGHT * height))


def _relative_calibre(age_months: float) -> float:
    # Volume = length x calibre squared, for any bend of the centreline (Pappus).
    volume = path_volume_cm3(age_months) / path_volume_cm3(MAX_AGE_MONTHS)
    return float(np.sqrt(volume / _relative_length(age_months)))


def sizes(age_months: float, weight_kg: float, sex: float) -> Sizes:
    """Sizes of the airway without individual variation.

    Args:
        age_months: 0 to 240, clamped outside.
        weight_kg: above 0.
        sex: -1 (female) to +1 (male); it acts after puberty and only on ``Sizes.larynx``.
    """
    age = float(np.clip(age_months, _CHART_MONTHS[0], _CHART_MONTHS[-1]))
    relative_weight = weight_kg / median_weight_kg(age)
    calibre = _relative_calibre(age)
    puberty = float(smooth_step(age, *_PUBERTY_MONTHS))
    return Sizes(
        length=_relative_length(age) * relative_weight**LENGTH_PER_WEIGHT,
        calibre=calibre * relative_weight**CALIBRE_PER_WEIGHT,
        nasal_calibre=calibre * relative_weight**NASAL_CALIBRE_PER_WEIGHT,
        larynx=1.0 + _LARYNX_SEX_SHARE * sex * puberty,
    )
