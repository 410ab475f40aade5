"""Pictures at scalings that are no whole number."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys

import numpy as np
import pytest
from PySide6.QtGui import QImage


@pytest.mark.skipif(sys.platform != "linux" or shutil.which("Xvfb") is None, reason="needs a virtual display")
@pytest.mark.parametrize("scaling", ["1.25", "1.75"])
def test_no_line_between_views_stays_black(egg_atlas, tmp_path, scaling):
    """Between two viewports whose edges were rounded apart nobody draws, and OpenGL begins with black."""
    picture = tmp_path / "window.png"
    arguments = ["-m", "naisr_viewer", str(egg_atlas), "--screenshot", str(picture), "--size", "901x583"]
    surroundings = {
        key: value for key, value in os.environ.items() if key not in ("DISPLAY", "WAYLAND_DISPLAY")
    }
    surroundings |= {"QT_SCALE_FACTOR": scaling, "XDG_CACHE_HOME": str(tmp_path)}
    done = subprocess.run([sys.executable, *arguments], env=surroundings, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    image = QImage(str(picture)).convertToFormat(QImage.Format.Format_Grayscale8)
    assert image.width() == round(901 * float(scaling))
    grey = np.frombuffer(image.constBits(), np.uint8).reshape(image.height(), image.bytesPerLine())
    black = grey[:, : image.width()] < 24
    assert black.sum(axis=0).max() < image.height() / 8
    assert black.sum(axis=1).max() < image.width() / 8
