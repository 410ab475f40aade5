"""What this program is."""

from __future__ import annotations

from PySide6.QtWidgets import QMessageBox, QWidget


def about(parent: QWidget, version: str) -> None:
    """Name, version and what the pictures mean."""
    QMessageBox.about(
        parent,
        "About NAISR Atlas Explorer",
        f"<h3>NAISR Atlas Explorer {version}</h3>"
        "<p>How a shape changes with age, weight, sex and other covariates, one covariate at a time "
        "and together.</p>"
        "<p>Method: Jiao et al., <i>NAISR: A 3D Neural Additive Model for Interpretable Shape "
        "Representation</i>, ICLR 2024.</p>"
        "<p>For research. Not a medical device.</p>",
    )
