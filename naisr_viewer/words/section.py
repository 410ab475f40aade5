"""What is said of the plane that cuts the shapes."""

from __future__ import annotations

from naisr_viewer.state.section import Cut, Plane, Section

TITLES = {
    Plane.SAGITTAL: "Sagittal, R–L",
    Plane.CORONAL: "Coronal, A–P",
    Plane.AXIAL: "Axial, S–I",
    Plane.FREE: "As seen now",
}
"""What the planes are called."""

HINT = "Which way the plane lies that cuts all shapes; “as seen now” faces you as the camera stands"
OFFSET_HINT = (
    "Where the plane is, in mm from the origin of the atlas along x (left), y (back), z (up) or its normal"
)
FLIP_HINT = "Show the other side of the plane"

AXES = {Plane.SAGITTAL: "x", Plane.CORONAL: "y", Plane.AXIAL: "z", Plane.FREE: "d"}


def place(section: Section) -> str:
    """Where the plane is: ``x = −12.3 mm``."""
    return f"{AXES[section.plane]}\u00a0=\u00a0{section.offset_mm + 0.0:.1f}\u00a0mm".replace("-", "−")


def area(cut: Cut) -> str:
    """How large a cut is: ``cut 412 mm²``; of an open surface, and of one that is missed, what is so."""
    if len(cut.lines) == 0:
        return "not cut"
    if cut.area_mm2 is None:
        return "cut: open, no area"
    digits = 0 if cut.area_mm2 >= 99.5 else 1 if cut.area_mm2 >= 9.95 else 2
    return f"cut {cut.area_mm2:,.{digits}f}\u00a0mm²"
