"""What is remembered from one run to the next, whatever has become of the file."""

from __future__ import annotations

from pathlib import Path

import pytest
from PySide6.QtCore import QSettings

from naisr_viewer.control.preferences import Preferences
from naisr_viewer.state.questions import OPEN_ATLAS
from naisr_viewer.state.theme import ThemeChoice


def preferences(file: Path) -> Preferences:
    return Preferences(QSettings(str(file), QSettings.Format.IniFormat))


def written(file: Path, atlas: Path) -> None:
    first = preferences(file)
    first.set_theme(ThemeChoice.DARK)
    first.remember(atlas)
    first.set_asks(OPEN_ATLAS, False)
    first._settings.sync()


def test_what_was_said_is_there_in_the_next_run(tmp_path, atlas_file):
    written(tmp_path / "p.ini", atlas_file)
    again = preferences(tmp_path / "p.ini")
    assert (again.theme, again.recent, again.asks(OPEN_ATLAS)) == (ThemeChoice.DARK, [atlas_file], False)


@pytest.mark.parametrize(
    "content",
    [
        "[General]\ntheme=neon\n",
        "[General]\ntheme=@ByteArray(dark)\n",
        "[General]\nrecent=@ByteArray(x)\n",
        "[General]\nrecent=7, @Invalid(), a\\x0\n",
        f"[General]\nrecent={'a' * 5000}\n",
        "[General]\ngeometry=7\n",
        f"[asks]\n{OPEN_ATLAS.name}=perhaps\n",
        "\0\1garbage",
        "",
    ],
)
def test_what_is_damaged_counts_as_never_said(tmp_path, content):
    (tmp_path / "p.ini").write_text(content)
    found = preferences(tmp_path / "p.ini")
    assert (found.theme, found.recent, found.asks(OPEN_ATLAS)) == (ThemeChoice.SYSTEM, [], True)
    assert found.geometry.isEmpty()


def test_a_full_disk_takes_nothing_away(tmp_path, atlas_file, no_room):
    file = tmp_path / "p.ini"
    written(file, atlas_file)
    before = file.read_bytes()
    with no_room(10):
        later = preferences(file)
        later.set_theme(ThemeChoice.LIGHT)
        later._settings.sync()
    assert file.read_bytes() == before and [each.name for each in tmp_path.glob("p.ini*")] == ["p.ini"]
