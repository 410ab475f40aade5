"""What a program owes whoever started it, tried in programs of their own."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from naisr_model.errors import InputError
from naisr_model.terminal import run

ROOT = Path(__file__).parents[2]
STOPPED = "tool: stopped; what was finished is kept\n"


def program(code: str, **options) -> subprocess.CompletedProcess[str]:
    """Run ``work()``, defined by ``code``, as the program ``tool``."""
    text = (
        textwrap.dedent(code)
        + "\nimport sys\nfrom naisr_model.terminal import run\nsys.exit(run('tool', work, is_all=True))"
    )
    environment = {**os.environ, "PYTHONPATH": str(ROOT), **options.pop("env", {})}
    channels = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | options
    return subprocess.run(
        [sys.executable, "-c", text], text=True, timeout=300, env=environment, check=False, **channels
    )


def test_input_that_cannot_be_used_is_one_sentence_with_its_notes(capsys):
    def work() -> int:
        error = InputError("the age is 412; give 1 to 233")
        error.add_note("rejected row 3")
        raise error

    assert run("tool", work, is_all=False) == 2
    assert capsys.readouterr().err == "rejected row 3\ntool: the age is 412; give 1 to 233\n"


def test_ctrl_c_is_one_sentence_whatever_a_library_makes_of_it(capsys):
    def work() -> int:
        try:
            signal.raise_signal(signal.SIGINT)
        except BaseException as error:
            raise TypeError("odd") from error
        return 0

    before = signal.getsignal(signal.SIGINT)
    assert run("tool", work, is_all=False) == 130
    assert capsys.readouterr().err == STOPPED
    assert signal.getsignal(signal.SIGINT) is before


def test_ctrl_c_is_not_swallowed_by_a_library_that_is_being_loaded(tmp_path):
    (tmp_path / "careless.py").write_text(
        "import signal\ntry:\n    signal.raise_signal(signal.SIGINT)\nexcept BaseException:\n    pass\n"
    )
    done = program(
        f"""
        def work():
            import sys
            sys.path.insert(0, {str(tmp_path)!r})
            import careless
            print("went on")
            return 0
        """
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "", STOPPED)


def test_a_second_ctrl_c_does_not_wait_for_a_clean_end():
    done = program(
        """
        import signal
        def work():
            try:
                signal.raise_signal(signal.SIGINT)
            finally:
                signal.raise_signal(signal.SIGINT)
                print("went on")
        """
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "", STOPPED)


@pytest.mark.parametrize("encoding", ["ascii", "cp932", "cp1252", "utf-8"])
def test_words_that_a_stream_has_no_letters_for_are_no_fault(encoding):
    environment = {"PYTHONIOENCODING": encoding, "PYTHONUTF8": "0"}
    code = "def work():\n    print('46.7 cm\\u00b3 \\u6f22 done')\n    return 0"
    done = program(code, env=environment, encoding=encoding)
    assert done.returncode == 0 and done.stderr == ""
    assert done.stdout.startswith("46.7 cm") and done.stdout.endswith(" done\n")


def test_nobody_need_read_what_is_told():
    reading, writing = os.pipe()
    os.close(reading)
    code = "def work():\n    for _ in range(20000): print('a line')\n    return 0"
    done = program(code, stdout=writing)
    os.close(writing)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no full device")
def test_an_output_that_is_full_is_one_sentence():
    with open("/dev/full", "w") as full:
        done = program("def work():\n    print('a line')\n    return 0", stdout=full)
    assert done.returncode == 2
    assert done.stderr == "tool: what it tells cannot be written: No space left on device\n"


@pytest.mark.skipif(sys.platform == "win32", reason="descriptors are closed in another way")
def test_closed_streams_never_become_a_file(tmp_path):
    """What a library writes to a stream must not end up in the results."""
    path = tmp_path / "result.txt"
    code = f"""
    import os
    os.close(1), os.close(2)
    def work():
        with open({str(path)!r}, "w") as file:
            os.write(1, b"noise"), os.write(2, b"noise")
            file.write("result")
        return 0
    """
    assert program(code).returncode == 0
    assert path.read_text() == "result"
