"""What is told of an atlas is so."""

from __future__ import annotations

import numpy as np

from naisr_viewer.words.atlas import about_atlas


def test_people_are_counted_and_covariates_have_their_ranges(card):
    people = card.population
    trained = int(np.sum(~people.held_out))
    first, age, *rest = about_atlas(card)
    assert first == (
        f"Trained on {trained} shapes of {trained} subjects; "
        f"{200 - trained} shapes of {200 - trained} subjects held out."
    )
    assert age == "Age: 1 to 220 months, mean 100 months."
    assert "Sex: F or M." in rest and rest[-1].endswith("ellipsoid.safetensors")
