"""The command ``naisr-viewer``."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

import nrrd
import numpy as np
import pytest
from eggs import egg, label_volume
from PySide6.QtGui import QImage

from naisr_model import __version__
from naisr_model.errors import InputError
from naisr_viewer import app
from naisr_viewer.engine.engine import Engine
from naisr_viewer.program import start

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
        timeout=600,
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
        ("age=1_0", "expected a number in months"),
        ("age=50,age=60", "'age' is given twice after --set"),
    ],
)
def test_a_bad_setting_is_explained(card, setting, complaint):
    with pytest.raises(InputError, match=complaint):
        app.parse_settings(card, [setting])


def test_a_covariate_is_set_once(card):
    with pytest.raises(InputError, match="'age' is given twice after --set; give it once"):
        app.parse_settings(card, ["age=50", "age=60"])


def test_the_end_of_the_range_as_it_is_told_is_accepted(card):
    assert app.parse_settings(card, ["weight=95.04"]) == {"weight": 95.04}


def test_a_mesh_in_the_place_of_the_atlas_is_told_by_its_contents(capsys, tmp_path):
    egg(5.0, 1.0).export(tmp_path / "p01.stl")
    assert app.main([str(tmp_path / "p01.stl"), "--set", "age=3"]) == 2
    told = capsys.readouterr().err
    assert "is a mesh (STL), not an atlas" in told and "--scan p01.stl" in told and told.count("\n") == 1


def test_sizes():
    assert app.parse_size("2560x1440") == (2560, 1440)
    for bad in (
        "big",
        "100x100",
        "99999x99999",
        "7681x800",
        "1280",
        "1280x",
        "1²80x800",
        "-1280x800",
        "1280x800x2",
    ):
        with pytest.raises(InputError, match="WIDTHxHEIGHT"):
            app.parse_size(bad)


def test_a_measurement_takes_no_other_task(capsys, atlas_file, tmp_path):
    wanted, picture = tmp_path / "m.json", tmp_path / "c.png"
    assert app.main([str(atlas_file), "--measure", str(wanted), "--screenshot", str(picture)]) == 2
    assert "leave out the other options" in capsys.readouterr().err
    assert not wanted.exists() and not picture.exists()


def test_a_missing_file_is_one_sentence_and_code_2(capsys, tmp_path):
    assert app.main([str(tmp_path / "none.safetensors")]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "does not exist; give the path of an atlas" in error


def test_an_unknown_option_is_one_sentence_and_code_2(capsys):
    assert app.main(["--colour", "red"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "--colour" in error


def test_a_bad_setting_ends_the_program_with_code_2(capsys, engine, atlas_file, monkeypatch):
    monkeypatch.setattr(start, "make_engine", lambda _: engine)
    assert app.main([str(atlas_file), "--set", "age=500"]) == 2
    assert "1 to 220 months" in capsys.readouterr().err


def test_a_device_that_cannot_compute_ends_the_program_with_code_2(capsys):
    assert app.main(["--device", "typewriter", "--set", "age=100"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "torch cannot compute on 'typewriter' here; choose cpu" in error


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


@pytest.mark.skipif(shutil.which("Xvfb") is None, reason="needs a virtual display")
def test_screenshot_and_demonstration_without_any_display(egg_atlas, tmp_path):
    picture, out = tmp_path / "picture.png", tmp_path / "out"
    arguments = [str(egg_atlas), "--screenshot", str(picture), "--demo", str(out), "--size", "1000x700"]
    code = f"import sys; from naisr_viewer import app; sys.exit(app.main({arguments!r} + ['--set', 'age=3']))"
    done = run(code, *DISPLAY)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    assert str(picture) in done.stdout
    assert str(out) in done.stdout
    image = QImage(str(picture))
    assert (image.width(), image.height()) == (1000, 700)
    assert len({image.pixel(x, y) for x in range(340, 1000, 7) for y in range(80, 660, 7)}) > 100
    names = {path.name for path in out.iterdir()}
    assert {"age-low.png", "sex-high.png", "patient-fit.png", "patient-before-and-after.png"} <= names
    assert "dragged age" in done.stdout and "dragged sex" in done.stdout
    (full_shape,) = out.glob("eggs-full-shape_*.stl")
    record = json.loads(full_shape.with_name(f"{full_shape.name}.json").read_text())
    assert record["covariates"]["sex"]["value"] == 0.0  # every slider was put back
    assert record["covariates"]["age"]["value"] > 6


@pytest.mark.skipif(shutil.which("Xvfb") is None, reason="needs a virtual display")
def test_a_picture_that_cannot_be_written_is_not_said_to_be(egg_atlas, tmp_path):
    arguments = [str(egg_atlas), "--screenshot", str(tmp_path / "picture.nonsense")]
    done = run(f"import sys; from naisr_viewer import app; sys.exit(app.main({arguments!r}))", *DISPLAY)
    assert done.returncode == 2 and "end its name with .png" in done.stderr
    assert done.stdout == "" and list(tmp_path.rglob("*picture*")) == []


@pytest.mark.skipif(shutil.which("Xvfb") is None, reason="needs a virtual display")
def test_a_scan_is_opened_at_once(egg_atlas, tmp_path):
    scan = tmp_path / "p01.ply"
    egg(5.0, 1.0).export(scan)
    arguments = [str(egg_atlas), "--scan", str(scan), "--screenshot", str(tmp_path / "scan.png")]
    done = run(f"import sys; from naisr_viewer import app; sys.exit(app.main({arguments!r}))", *DISPLAY)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "scan.png").is_file()
    arguments[2] = str(tmp_path / "none.ply")
    done = run(f"import sys; from naisr_viewer import app; sys.exit(app.main({arguments!r}))", *DISPLAY)
    assert done.returncode == 2 and "none.ply" in done.stderr and done.stderr.count("\n") == 1


def test_nobody_is_asked_for_a_label_where_nobody_sits(capsys, engine, atlas_file, tmp_path, monkeypatch):
    monkeypatch.setattr(start, "make_engine", lambda _: engine)
    scan, picture = label_volume(tmp_path / "scan.nrrd"), tmp_path / "picture.png"
    for task in ("--screenshot", "--demo"):
        assert app.main([str(atlas_file), "--scan", str(scan), task, str(picture)]) == 2
        error = capsys.readouterr().err
        assert error.count("\n") == 1
        assert "scan.nrrd has 2 labels (1: 0.064 cm³, 2 'egg': 58.9 cm³); choose one with --label" in error
    steps = {"space": "LPS", "space directions": np.eye(3), "space origin": np.zeros(3)}
    nrrd.write(str(scan), np.pad(np.full((9, 9, 9), -1, np.int16), 1), steps)
    assert app.main([str(atlas_file), "--scan", str(scan), "--screenshot", str(picture)]) == 2
    assert "has a negative label alone (-1: 0.729 cm³); choose one with --label" in capsys.readouterr().err
    assert app.main([str(atlas_file), "--label", "2", "--screenshot", str(picture)]) == 2
    assert "give --scan FILE too" in capsys.readouterr().err
    assert not picture.exists()


@pytest.mark.skipif(shutil.which("Xvfb") is None, reason="needs a virtual display")
@pytest.mark.parametrize(("label", "complaint"), [("egg", ""), ("nose", "has no label nose; it has 1: ")])
def test_the_label_of_a_scan_is_chosen_on_the_command_line(egg_atlas, tmp_path, label, complaint):
    scan, picture = label_volume(tmp_path / "scan.nrrd"), tmp_path / "picture.png"
    arguments = [str(egg_atlas), "--scan", str(scan), "--label", label, "--screenshot", str(picture)]
    done = run(f"import sys; from naisr_viewer import app; sys.exit(app.main({arguments!r}))", *DISPLAY)
    assert done.returncode == (2 if complaint else 0) and complaint in done.stderr
    assert picture.exists() is not bool(complaint)


@pytest.mark.skipif(shutil.which("Xvfb") is None, reason="needs a virtual display")
def test_numbers_are_the_same_under_a_locale_with_a_decimal_comma(tmp_path):
    scan = tmp_path / "scan.nrrd"
    steps = {"space": "LPS", "space directions": np.diag([1.5, 1.5, 2.5]), "space origin": np.full(3, 0.5)}
    nrrd.write(str(scan), np.ones((4, 4, 4), np.uint8), steps)
    # A locale of this test's own where the machine has what it takes; without one, C is what is left.
    if shutil.which("localedef"):
        make = ["localedef", "-i", "de_DE", "-f", "UTF-8", str(tmp_path / "de_DE.UTF-8")]
        subprocess.run(make, capture_output=True, check=False)
    done = run(
        f"""
        import locale, os
        os.environ |= {{"LC_ALL": "de_DE.UTF-8", "LOCPATH": {str(tmp_path)!r}}}
        from naisr_viewer.program import display, start
        display.ensure_display((640, 480))
        application = start.make_application()
        from naisr_model.data.volumes import read_labels
        volume = read_labels({str(scan)!r})
        print(locale.setlocale(locale.LC_NUMERIC), volume.spacing_mm.tolist(), volume.to_lps_mm[0, 3])
        """,
        *DISPLAY,
    )
    assert done.stdout == "C [1.5, 1.5, 2.5] 0.5\n", done.stderr


@pytest.mark.skipif(shutil.which("Xvfb") is None, reason="needs a virtual display")
def test_the_second_start_paints_the_first_picture_before_the_networks_are_imported(egg_atlas, tmp_path):
    cache = tmp_path / "cache"
    first = Engine(folder=cache)
    first.open(egg_atlas)
    first.prepare_previews(egg_atlas)
    done = run(
        f"""
        import sys
        from pathlib import Path
        from naisr_viewer.engine import engine
        from naisr_viewer.program import headless, start
        from naisr_viewer.program.display import ensure_display
        from naisr_viewer.panels.kinds import visible_panels

        def note(_count):
            shown = [controller.shown.get(panel) for panel in visible_panels(controller.state)]
            if shown and all(result is not None and result.is_exact for result in shown):
                pictures.append({{"torch", "trimesh", "scipy", "igl"}} & set(sys.modules))

        ensure_display((800, 600))
        opened = engine.Engine(folder=Path({str(cache)!r}))
        application, pictures = start.make_application(), []
        window, controller = start.make_window(opened, Path({str(tmp_path / "settings.ini")!r}))
        window.shapes.drawn.connect(note)
        start.show(window, controller, start.First(Path({str(egg_atlas)!r})))
        headless.wait_until(lambda: bool(pictures), 60)
        headless.wait_until(lambda: opened.has_previews(controller.state.atlas.path), 60)
        window.close()
        print("imported:", sorted(pictures[0]), "in the end:", "torch" in sys.modules)
        """,
        *DISPLAY,
    )
    assert done.stdout == "imported: [] in the end: True\n", done.stderr


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
    monkeypatch.setattr(start, "make_engine", lambda _: engine)
    monkeypatch.setattr(shutil, "which", lambda _: None)
    assert app.main([str(atlas_file), "--screenshot", str(tmp_path / "x.png")]) == 2
    error = capsys.readouterr().err
    assert "install the package 'xvfb'" in error
    assert error.count("\n") == 1
