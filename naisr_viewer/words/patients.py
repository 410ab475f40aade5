"""What the right side says of a scan and a fit, in words."""

from __future__ import annotations

from collections.abc import Sequence

from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.state.patients import Fitted, Method, Scan, Stated
from naisr_viewer.words.numbers import capitalised, duration, given, interval_reading, length, reading, volume
from naisr_viewer.words.titles import label

LONGEST_WORD, LONGEST_IN_TABLE = 28, 14
"""Letters that surely fit into a line, and into half of one; longer names are broken anywhere."""

RESIDUAL = "mean distance, scan to fitted shape"

METHODS: tuple[tuple[Method, str], ...] = (
    ("none", "as in the file"),
    ("icp", "rigid (ICP)"),
    ("landmarks", "landmarks…"),
)
UNITS: tuple[tuple[float | None, str], ...] = (
    (None, "guessed"),
    (1.0, "mm"),
    (10.0, "cm"),
    (1000.0, "m"),
    (25.4, "inch"),
)
"""Millimetres per unit of the file, and what the unit is called."""


def units(scale: float | None) -> tuple[tuple[float | None, str], ...]:
    """The units on offer, with ``scale`` among them whatever it is."""
    return UNITS if scale in dict(UNITS) else (*UNITS, (scale, f"{scale:g} mm"))


def scans_of(atlas: AtlasCard) -> str:
    """Which files hold a shape that an atlas can be fitted to."""
    if atlas.is_flat:
        return "an outline as a drawing (SVG), as points (CSV) or in a label image (PNG, TIFF)"
    return "a mesh, a label volume or a cloud of points"


def size_of(scan: Scan, atlas: AtlasCard) -> str:
    """The volume or area of a scan, or what it is where it encloses none."""
    if scan.extent is not None:
        return volume(scan.extent, None, atlas.frame.extent)
    return "open surface" if len(scan.faces) else "cloud of points"


def measured(scan: Scan, atlas: AtlasCard) -> str:
    """The volume or area of a scan, or why it has none, as a line of the panel."""
    told = size_of(scan, atlas)
    return f"{told}, no {atlas.frame.extent.title}" if scan.extent is None else f"encloses {told}"


def findings(fit: Fitted, atlas: AtlasCard) -> list[tuple[str, str, str]]:
    """The rows of the result: what, its value with unit, and how sure or what it means.

    Of a fit that is not valid only how far it is off: its covariates and its volume are not the patient's.
    """
    extent, residual = atlas.frame.extent, length(fit.residual_mm, atlas.frame.unit)
    if not fit.is_valid:
        return [("Residual", residual, RESIDUAL), ("Time", duration(fit.seconds), "")]
    values = dict(fit.values)
    sure = {name: (low, high) for name, low, high in fit.intervals}
    rows = []
    for each in atlas.covariates:
        value = values[each.name]
        if each.name in sure:
            told = reading(each, value), interval_reading(each, *sure[each.name])
        else:
            told = given(each, value), "known"
        rows.append((label(each.name), *told))
    lasting = []
    if fit.lasting is not None:
        lasting.append(("Lasting", f"{100 * fit.lasting:.0f} %", "of what sets the patient apart"))
    return [
        *rows,
        (extent.title.capitalize(), f"{volume(fit.extent, fit.extent_margin, extent)} (95\u00a0%)", ""),
        ("Residual", residual, RESIDUAL),
        *lasting,
        ("Time", duration(fit.seconds), ""),
    ]


def found_volume(fit: Fitted | None, atlas: AtlasCard) -> str:
    """What the list says of a patient."""
    if fit is None:
        return "not fitted"
    return volume(fit.extent, None, atlas.frame.extent) if fit.is_valid else "not valid"


def barred(name: str, fit: Fitted) -> str:
    """Why a patient whose fit is not valid cannot be compared with."""
    return f"{name} cannot be compared with; its fit is {'; '.join(fit.remarks)}"


def sentence(text: str) -> str:
    """``text`` as it stands in the panel, with a capital letter in front."""
    return breakable(capitalised(text))


def breakable(text: str, longest: int = LONGEST_WORD) -> str:
    """``text`` with words of more letters than the ``longest`` that can be broken anywhere."""
    return " ".join("\u200b".join(word) if len(word) > longest else word for word in text.split(" "))


def doubt(name: str, stated: Sequence[Stated]) -> str:
    """Why nothing was taken of what a table says of a scan, a sentence; empty where it was."""
    if not stated:
        return f"no row names {name}; its column 'mesh' has to hold the file."
    if faults := [each.fault for each in stated if each.fault]:
        return f"the row of {name} cannot be used: {faults[0]}."
    if len(stated) > 1:
        return f"{len(stated)} rows say different things of {name}; leave one."
    return ""
