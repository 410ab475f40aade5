"""What this program is, and the atlas that is open."""

from __future__ import annotations

import html

from PySide6.QtWidgets import QMessageBox, QWidget

from naisr_viewer.state.atlas_card import AtlasCard
from naisr_viewer.words.atlas import about_atlas
from naisr_viewer.words.titles import label


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


def tell_of_atlas(parent: QWidget, card: AtlasCard) -> None:
    """Who is behind an atlas, and what it can do."""
    lines = "".join(f"<p>{html.escape(line, quote=False)}</p>" for line in about_atlas(card))
    name = html.escape(label(card.name), quote=False)
    QMessageBox.about(parent, "About this atlas", f"<h3>{name} atlas</h3>{lines}")
