"""Files that are replaced whole, whatever happens meanwhile."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from naisr_model.errors import InputError
from naisr_model.files import replacing, sources_digest


def test_the_content_is_on_the_disk_before_it_takes_its_place(tmp_path, monkeypatch):
    path, steps = tmp_path / "kept.txt", []
    replace, sync = os.replace, os.fsync

    def synced(descriptor: int) -> None:
        steps.append(("synced", os.fstat(descriptor).st_ino))
        sync(descriptor)

    def replaced(old: Path, new: Path) -> None:
        steps.append(("replaced", old.stat().st_ino))
        replace(old, new)

    monkeypatch.setattr(os, "fsync", synced)
    monkeypatch.setattr(os, "replace", replaced)
    with replacing(path) as temporary:
        temporary.write_text("new")
    number = path.stat().st_ino
    assert steps == [("synced", number), ("replaced", number)]


def test_writing_leaves_the_mask_of_the_process_alone(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "umask", lambda mask: pytest.fail("other threads would write with this mask"))
    with replacing(tmp_path / "kept.txt") as temporary:
        temporary.write_text("new")


@pytest.mark.parametrize("name", ["", ".", "/"])
def test_a_folder_is_no_file_to_write(name):
    with pytest.raises(InputError, match="is a folder; give the name of a file"), replacing(Path(name)):
        pytest.fail("nothing can be written there")


@pytest.mark.skipif(sys.platform == "win32", reason="there are no such permissions")
def test_a_file_gets_the_permissions_of_any_other(tmp_path):
    program = (
        "import os, pathlib, sys; os.umask(0o027)\n"
        "from naisr_model.files import replacing, sources_digest\n"
        "with replacing(pathlib.Path(sys.argv[1])) as temporary:\n"
        "    os.close(os.open(temporary, os.O_CREAT, 0o600))\n"
        "pathlib.Path(sys.argv[2]).touch()\n"
    )
    saved, plain = tmp_path / "saved.txt", tmp_path / "plain.txt"
    subprocess.run(
        [sys.executable, "-c", program, str(saved), str(plain)], check=True, cwd=Path(__file__).parents[2]
    )
    assert saved.stat().st_mode == plain.stat().st_mode
    assert plain.stat().st_mode & 0o777 == 0o640


def test_sources_are_known_by_what_they_say_and_not_by_where_they_are(tmp_path):
    def program(name: str, **sources: str) -> Path:
        for source, text in sources.items():
            file = tmp_path / name / "inner" / f"{source}.py"
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text)
        return tmp_path / name

    first = sources_digest(program("a", one="x = 1", two="y = 2"))
    assert first == sources_digest(program("moved", one="x = 1", two="y = 2"))
    assert first != sources_digest(program("b", one="x = 1", two="y = 3"))
    assert first != sources_digest(program("c", one="x = 1"))
    assert first != sources_digest(program("a"), program("b"))
