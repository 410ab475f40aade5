"""Files that are replaced whole, whatever happens meanwhile."""

from __future__ import annotations

import ast
import errno
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from naisr_model.errors import InputError
from naisr_model.files import (
    ABANDONED_S,
    checked_place,
    forget_unfinished,
    replacing,
    replacing_folder,
    sources_digest,
    write_all,
)

ROOT = Path(__file__).parents[2]


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


def test_a_failed_write_leaves_the_old_file_and_no_rubbish(tmp_path):
    path = tmp_path / "shape.stl"
    path.write_text("the old one")
    with pytest.raises(InputError, match="No space left"), replacing(path) as temporary:
        temporary.write_text("half of the new")
        raise OSError(28, "No space left on device")
    assert path.read_text() == "the old one"
    assert os.listdir(tmp_path) == ["shape.stl"]


@pytest.mark.parametrize("name", ["", ".", "/"])
def test_a_folder_is_no_file_to_write(name):
    with pytest.raises(InputError, match="is a folder; give the name of a file"), replacing(Path(name)):
        pytest.fail("nothing can be written there")


@pytest.mark.skipif(sys.platform == "win32", reason="there are no such permissions")
def test_a_file_gets_the_permissions_of_any_other(tmp_path):
    program = (
        "import os, pathlib, sys; os.umask(0o027)\n"
        "from naisr_model.files import replacing\n"
        "with replacing(pathlib.Path(sys.argv[1])) as temporary:\n"
        "    os.close(os.open(temporary, os.O_CREAT, 0o600))\n"
        "pathlib.Path(sys.argv[2]).touch()\n"
    )
    saved, plain = tmp_path / "saved.txt", tmp_path / "plain.txt"
    subprocess.run([sys.executable, "-c", program, str(saved), str(plain)], check=True, cwd=ROOT)
    assert saved.stat().st_mode == plain.stat().st_mode
    assert plain.stat().st_mode & 0o777 == 0o640


def refusing(number: int):
    """Stands for a call that a file system refuses."""

    def refuse(*_args: object, **_options: object) -> None:
        raise OSError(number, os.strerror(number))

    return refuse


@pytest.mark.parametrize("number", [errno.EPERM, errno.EINVAL, errno.ENOSYS, errno.EROFS])
def test_what_a_file_system_cannot_do_does_not_decide(tmp_path, monkeypatch, number):
    monkeypatch.setattr(os, "fsync", refusing(number))
    monkeypatch.setattr(Path, "chmod", refusing(number))
    monkeypatch.setattr(os, "chmod", refusing(number))
    with replacing(tmp_path / "kept.txt") as temporary:
        temporary.write_text("new")
    assert (tmp_path / "kept.txt").read_text() == "new" and os.listdir(tmp_path) == ["kept.txt"]


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT, errno.EIO])
def test_content_that_is_not_on_the_disk_takes_no_place(tmp_path, monkeypatch, number):
    (tmp_path / "kept.txt").write_text("old")
    monkeypatch.setattr(os, "fsync", refusing(number))
    with (
        pytest.raises(InputError, match=rf"cannot write .*kept\.txt: {os.strerror(number)}; "),
        replacing(tmp_path / "kept.txt") as temporary,
    ):
        temporary.write_text("new")
    assert (tmp_path / "kept.txt").read_text() == "old" and os.listdir(tmp_path) == ["kept.txt"]


SMALL_FILES = """
import resource, sys
from pathlib import Path
from naisr_model.errors import InputError
resource.setrlimit(resource.RLIMIT_FSIZE, (8_000, 8_000))
try:
{writing}
except InputError as error:
    print(error)
"""

WRITERS = {
    "a checkpoint": """
    import torch, dataclasses
    from naisr_model import checkpoint
    found = checkpoint.load("ATLAS")
    checkpoint.save(Path("OUT/file.safetensors"), found)
    """,
    "tabulated displacements": """
    import numpy as np
    from naisr_model.surface.displacements import DisplacementTable, DisplacementTables
    table = DisplacementTable(0.1, np.arange(4.0), np.zeros((4, 30, 30, 30, 3), np.float32))
    DisplacementTables(np.zeros((2, 3)), (table,)).save(Path("OUT/file.safetensors"))
    """,
    "a folder of samples": """
    from naisr_model.files import replacing_folder
    with replacing_folder(Path("OUT/file")) as temporary:
        (temporary / "few").write_bytes(bytes(100))
        (temporary / "many").write_bytes(bytes(100_000))
    """,
    "a journal": """
    from naisr_model.work.journal import keeping
    with keeping(Path("OUT/file.jsonl"), {"study": "Reach"}) as (_, keep):
        for number in range(1000):
            keep(str(number), {"text": "x" * 100})
    """,
}


@pytest.mark.skipif(sys.platform == "win32", reason="there is no limit for files")
@pytest.mark.parametrize("what", WRITERS)
def test_what_finds_no_room_is_one_sentence_with_the_file_and_leaves_nothing(tmp_path, egg_atlas, what):
    """A limit for the size of files stands for a full disk, which needs no privileges."""
    writing = WRITERS[what].replace("OUT", str(tmp_path)).replace("ATLAS", str(egg_atlas))
    done = subprocess.run(
        [sys.executable, "-c", SMALL_FILES.format(writing=writing)],
        capture_output=True,
        text=True,
        check=False,
        cwd=ROOT,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(f"cannot write {tmp_path / 'file'}") and done.stdout.count("\n") == 1
    assert "File too large" in done.stdout
    kept = {"file.jsonl"} if what == "a journal" else set()
    assert set(os.listdir(tmp_path)) == kept


@pytest.mark.skipif(sys.platform == "win32", reason="there are no such files")
def test_a_device_or_a_pipe_is_no_place_for_a_file(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path in (Path("/dev/null"), tmp_path / "pipe"):
        with pytest.raises(InputError, match="is a device or a pipe; give the name of a file"):
            checked_place(path)
    assert not Path("/dev/null").is_file()


def test_a_place_is_looked_at_before_the_work(tmp_path):
    (tmp_path / "file").write_text("precious")
    for path in (tmp_path, Path("."), Path("/")):
        with pytest.raises(InputError, match="is a folder; give the name of a file to write"):
            checked_place(path)
    with pytest.raises(InputError, match="is a file, no folder; choose another folder"):
        checked_place(tmp_path / "file" / "inner" / "x.json")
    assert checked_place(tmp_path / "new" / "x.json") == tmp_path.resolve() / "new" / "x.json"
    assert not (tmp_path / "new").exists()


def test_a_folder_that_cannot_be_written_to_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "access", lambda *_: False)  # root may write everywhere
    with pytest.raises(InputError, match="cannot be written to; choose another folder"):
        checked_place(tmp_path / "x.json")


@pytest.mark.skipif(sys.platform == "win32", reason="links need privileges")
def test_a_link_is_followed(tmp_path):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "link.txt").symlink_to(tmp_path / "elsewhere" / "true.txt")
    for text in ("first", "second"):
        with replacing(tmp_path / "link.txt") as temporary:
            temporary.write_text(text)
        assert (tmp_path / "link.txt").is_symlink()
        assert (tmp_path / "elsewhere" / "true.txt").read_text() == text
    assert os.listdir(tmp_path / "elsewhere") == ["true.txt"]


KILLED = """
import os, signal, sys
from pathlib import Path
from naisr_model.files import replacing
with replacing(Path(sys.argv[1])) as temporary:
    temporary.write_text("half of the new")
    os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="there is no such signal")
def test_what_a_killed_run_left_goes_with_a_later_one(tmp_path):
    path = tmp_path / "shape.stl"
    path.write_text("the old one")
    subprocess.run([sys.executable, "-c", KILLED, str(path)], check=False, cwd=ROOT)
    (left,) = set(os.listdir(tmp_path)) - {"shape.stl"}
    assert path.read_text() == "the old one"
    other = tmp_path / ".shape.mine.stl"
    other.write_text("the user's own")
    with replacing(path) as temporary:
        temporary.write_text("new")
    assert left in os.listdir(tmp_path)  # it might be of a run that goes on
    long_ago = time.time() - 2 * ABANDONED_S
    for file in (tmp_path / left, other):
        os.utime(file, (long_ago, long_ago))
    with replacing(path) as temporary:
        temporary.write_text("newer")
    assert sorted(os.listdir(tmp_path)) == [".shape.mine.stl", "shape.stl"]
    subprocess.run([sys.executable, "-c", KILLED, str(path)], check=False, cwd=ROOT)
    forget_unfinished(path)  # of whoever alone writes there
    assert sorted(os.listdir(tmp_path)) == [".shape.mine.stl", "shape.stl"]


def test_files_that_belong_together_are_replaced_together(tmp_path, no_room):
    small, large = tmp_path / "a.txt", tmp_path / "new" / "b.txt"
    write_all([(small, b"1"), (large, b"2")])
    sentence = r"cannot write \S*b\.txt: File too large; "
    with no_room(100), pytest.raises(InputError, match=sentence):
        write_all([(small, b"3"), (large, bytes(1000))])
    with pytest.raises(InputError, match="no surface"):
        write_all((path, content_or_refusal(path)) for path in (small, large))
    assert (small.read_bytes(), large.read_bytes()) == (b"1", b"2")
    assert sorted(os.listdir(tmp_path)) == ["a.txt", "new"] and os.listdir(large.parent) == ["b.txt"]
    elsewhere = tmp_path / "new" / "inner" / "deep"
    with no_room(100), pytest.raises(InputError, match="File too large"):
        write_all([(elsewhere / "a.txt", b"1"), (elsewhere / "b.txt", bytes(1000))])
    assert os.listdir(large.parent) == ["b.txt"]  # nor are there folders that nobody asked for


def content_or_refusal(path: Path) -> bytes:
    if path.name == "b.txt":
        raise InputError("there is no surface")
    return b"5"


def test_a_folder_is_replaced_whole_or_not_at_all(tmp_path):
    path = tmp_path / "samples"
    with replacing_folder(path) as temporary:
        (temporary / "one.txt").write_text("1")
    with (
        pytest.raises(InputError, match=r"cannot write .*samples: No space left"),
        replacing_folder(path) as it,
    ):
        (it / "two.txt").write_text("2")
        raise OSError(errno.ENOSPC, "No space left on device")
    assert os.listdir(tmp_path) == ["samples"] and os.listdir(path) == ["one.txt"]
    with replacing_folder(path) as temporary:
        (temporary / "two.txt").write_text("2")
    assert os.listdir(tmp_path) == ["samples"] and os.listdir(path) == ["two.txt"]


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


SAFELY = {"replacing", "replacing_folder", "write_all", "telling"}


def writes(node: ast.AST) -> bool:
    """Whether a call puts something into a file."""
    if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Attribute):
        return False
    if node.func.attr in ("write_text", "write_bytes"):
        return True
    modes = [each.value for each in node.args if isinstance(each, ast.Constant)]
    return node.func.attr == "open" and any(set("wax+") & set(str(mode)) for mode in modes)


def test_whoever_writes_a_file_does_it_safely():
    found = {}
    for package in ("naisr_model", "naisr_viewer"):
        for path in (ROOT / package).rglob("*.py"):
            nodes = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
            imports = [each for each in nodes if isinstance(each, ast.ImportFrom)]
            known = {
                name.name for each in imports if each.module == "naisr_model.files" for name in each.names
            }
            if any(map(writes, nodes)) and path.name != "files.py":
                found[path.relative_to(ROOT).as_posix()] = bool(known & SAFELY)
    assert len(found) > 10
    assert [path for path, is_safe in found.items() if not is_safe] == []
