"""The command ``naisr-viewer``."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest
from PySide6.QtGui import QImage

from naisr_model import __version__
from naisr_model.errors import InputError
from naisr_viewer import app

ROOT = Path(__file__).parents[2]
DISPLAY = ("DISPLAY", "WAYLAND_DISPLAY")


def run(code: str, *hidden: str) -> subprocess.CompletedProcess[str]:
    """Run ``code`` in a process of its own, without the ``hidden`` environment variables."""
    return subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)],
        cwd=ROOT,
        env={name: value for name, value in os.environ.items() if name not in hidden},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def test_settings_are_read_in_real_units(card):
    assert app.parse_settings(card, ["age=120", " weight = 30.5", "sex=M"]) == {
        "age": 120.0,
        "weight": 30.5,
        "sex": 1.0,
    }


@pytest.mark.parametrize(
    ("setting", "complaint"),
    [
        ("age", "NAME=VALUE"),
        ("height=3", "one of age, weight, sex"),
        ("age=old", "expected a number in months"),
        ("sex=X", "expected F or M"),
        ("age=500", "1 to 220 months"),
    ],
)
def test_a_bad_setting_is_explained(card, setting, complaint):
    with pytest.raises(InputError, match=complaint):
        app.parse_settings(card, [setting])


def test_sizes():
    assert app.parse_size("2560x1440") == (2560, 1440)
    for bad in ("big", "100x100", "1280", "1280x"):
        with pytest.raises(InputError, match="WIDTHxHEIGHT"):
            app.parse_size(bad)


def test_a_missing_file_is_one_sentence_and_code_2(capsys, tmp_path):
    assert app.main([str(tmp_path / "none.safetensors")]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "there is no file" in error


def test_an_unknown_option_is_one_sentence_and_code_2(capsys):
    assert app.main(["--colour", "red"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "--colour" in error


def test_a_bad_setting_ends_the_program_with_code_2(capsys, engine, atlas_file, monkeypatch):
    monkeypatch.setattr(app, "Engine", lambda: engine)
    assert app.main([str(atlas_file), "--set", "age=500"]) == 2
    assert "1 to 220 months" in capsys.readouterr().err


def test_help_needs_nothing_heavy():
    done = run(
        """
        import sys
        from naisr_viewer.app import main
        code = main(["--help"]) or main(["--version"])
        heavy = {"torch", "vtkmodules", "pyvista", "PySide6.QtWidgets", "trimesh", "scipy"} & set(sys.modules)
        print("heavy:", sorted(heavy), "code:", code)
        """
    )
    assert "heavy: [] code: 0" in done.stdout, done.stderr
    assert "--set age=120 --set sex=M" in done.stdout
    assert __version__ in done.stdout


@pytest.fixture
def stand_in() -> str:
    """Code that puts the ellipsoids in the place of a trained atlas."""
    return f"""
        import runpy, sys
        sys.path.insert(0, {str(ROOT)!r})
        stand_in = runpy.run_path({str(Path(__file__).with_name("conftest.py"))!r})["EllipsoidAtlas"]
        from naisr_viewer import app, engine
        app.Engine = lambda: engine.Engine(lambda path: stand_in())
    """


@pytest.mark.skipif(shutil.which("Xvfb") is None, reason="needs a virtual display")
def test_screenshot_and_demonstration_without_any_display(stand_in, atlas_file, tmp_path):
    picture, out = tmp_path / "picture.png", tmp_path / "out"
    arguments = [str(atlas_file), "--screenshot", str(picture), "--demo", str(out), "--size", "800x600"]
    done = run(f"{stand_in}\n        sys.exit(app.main({arguments!r} + ['--set', 'weight=50']))", *DISPLAY)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    assert str(picture) in done.stdout
    assert str(out) in done.stdout
    image = QImage(str(picture))
    assert (image.width(), image.height()) == (800, 600)
    assert len({image.pixel(x, y) for x in range(340, 800, 7) for y in range(80, 560, 7)}) > 100
    names = {path.name for path in out.iterdir()}
    for covariate in ("age", "weight", "sex"):
        assert {f"{covariate}-low.png", f"{covariate}-high.png"} <= names
        assert f"dragged {covariate}" in done.stdout
    record = json.loads((out / "ellipsoid-full-shape.json").read_text())
    assert "ellipsoid-full-shape.stl" in names
    assert record["covariates"]["weight"]["value"] == 35.0  # every slider was put back


@pytest.fixture
def no_display(monkeypatch) -> None:
    if sys.platform != "linux":
        pytest.skip("other systems always have a display")
    for name in DISPLAY:
        monkeypatch.delenv(name, raising=False)


def test_without_display_a_window_for_a_person_is_refused_in_words(no_display, capsys, atlas_file):
    assert app.main([str(atlas_file)]) == 2
    assert "--screenshot, --demo or --measure" in capsys.readouterr().err


def test_without_display_and_xvfb_the_remedy_is_named(
    no_display, capsys, engine, atlas_file, monkeypatch, tmp_path
):
    monkeypatch.setattr(app, "Engine", lambda: engine)
    monkeypatch.setattr(shutil, "which", lambda _: None)
    assert app.main([str(atlas_file), "--screenshot", str(tmp_path / "x.png")]) == 2
    error = capsys.readouterr().err
    assert "install the package 'xvfb'" in error
    assert error.count("\n") == 1


def test_the_default_atlas_is_the_shipped_airway():
    assert app.default_atlas().name == "airway.safetensors"
