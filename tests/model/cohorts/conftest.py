"""A small cohort of eggs as a hospital brings it: some of its rows are broken on purpose."""

from __future__ import annotations

from pathlib import Path

import pytest
from eggs import egg, label_volume, saved, turned

ROWS = (
    "mesh,subject,visit,age [years],sex,label,site,landmarks",
    "whole.stl,A,1,6,M,,north,",
    "whole.stl,A,2,,,,north,",
    "volume.nii.gz,B,1,6,M,2,south,",
    "nowhere.stl,C,1,4,F,,south,",
    "text.stl,D,1,4,F,,south,",
    "whole.stl,E,1,old,F,,south,",
    "whole.stl,F,1,999,F,,south,",
    "small.stl,G,1,3,F,,south,",
    "small.stl,H,1,3,F,,south,",
    "small.stl,H,1,4,F,,south,",
    "far.stl,I,1,3,F,,<south>,",
    "volume.nii.gz,J,1,6,M,7,south,",
)
"""The header is row 1."""


@pytest.fixture(scope="session")
def cohort_table(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("cohort")
    saved(egg(6.0, 1.0), folder / "whole.stl")
    saved(egg(3.0, -1.0), folder / "small.stl")
    saved(egg(3.0, -1.0), folder / "far.stl", turned(0.0, [0.0, 900.0, 0.0]))
    (folder / "text.stl").write_text("this is no mesh")
    label_volume(folder / "volume.nii.gz")
    table = folder / "cohort.csv"
    table.write_text("\n".join(ROWS) + "\n")
    return table
