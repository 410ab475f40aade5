"""Sessions of the window: damaged, contradicting themselves, of other files, and of other kinds."""

from __future__ import annotations

import hashlib
import json
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from corpus import damage, shapes
from corpus.case import Case, Damage, Ending, Expected, Files, Goods, Special
from numpy.random import Generator

from naisr_viewer.files.sessions import write_session
from naisr_viewer.state.camera import FROM_THE_FRONT
from naisr_viewer.state.drawer import Tab
from naisr_viewer.state.explorer import ExplorerState
from naisr_viewer.state.layouts import Layout
from naisr_viewer.state.overlay import Overlay, Quantity
from naisr_viewer.state.patients import Reading
from naisr_viewer.state.pins import Pin
from naisr_viewer.state.session import SavedAtlas, SavedFit, SavedPatient, Session
from naisr_viewer.state.support import Support

FILE, ATLAS, SCAN = "mine.json", "eggs.safetensors", "egg.stl"
KNOWN = (("age", 6.0), ("sex", 1.0))
Record = dict[str, Any]


def good(goods: Goods) -> bytes:
    """All that a session can hold, but for a fit, which takes its time."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        state = ExplorerState(
            values=(6.0, 1.0),
            layout=Layout.SIDE_BY_SIDE,
            patient=1,
            pins=(Pin(2, (0.1, -2.0, 3.5)),),
            drawer=Tab.POINT,
            overlay=Overlay(Quantity.RATE, (("mm per year", 0.25),)),
            touched="age",
            support=Support("sex", "age", True),
        )
        atlas = SavedAtlas(folder / ATLAS, hashlib.sha256(goods.atlas).hexdigest())
        patients = (SavedPatient(1, "egg", Reading(folder / SCAN), KNOWN),)
        write_session(Session(atlas, state, patients, FROM_THE_FRONT), folder / FILE)
        return (folder / FILE).read_bytes()


def _files(goods: Goods, content: bytes) -> Files:
    return {FILE: content, ATLAS: goods.atlas, SCAN: shapes.stl(shapes.triangles())}


def _bytes(name: str, *damages: Damage, ending: Ending = "refused") -> Case:
    """The file with damaged bytes."""

    def make(goods: Goods, rng: Generator) -> Files:
        content = good(goods)
        for each in damages:
            content = each(content, rng)
        return _files(goods, content)

    return Case("session", name, make, (FILE,), Expected(ending), "session")


def _record(name: str, change: Callable[[Record], object], ending: Ending = "refused") -> Case:
    """What it says changed."""

    def make(goods: Goods, _rng: Generator) -> Files:
        record = json.loads(good(goods))
        change(record)
        return _files(goods, json.dumps(record).encode())

    return Case("session", f"record: {name}", make, (FILE,), Expected(ending), "session")


def _set(*keys: str | int, to: object) -> Callable[[Record], object]:
    """A change of one entry."""

    def change(record: Any) -> None:
        for key in keys[:-1]:
            record = record[key]
        record[keys[-1]] = to

    return change


def _beside(name: str, ending: Ending, says: str = "", **others: bytes | Special | None) -> Case:
    """Other files beside a good session; None for one that is not there."""

    def make(goods: Goods, _rng: Generator) -> Files:
        files = {
            **_files(goods, good(goods)),
            **{key.replace("_", "."): each for key, each in others.items()},
        }
        return {key: each for key, each in files.items() if each is not None}

    return Case("session", f"beside it {name}", make, (FILE,), Expected(ending, says=says), "session")


def _fitted(code: tuple[float, ...], record: Record) -> None:
    """The patient fitted, with a code that the fit did or did not have."""
    fit = SavedFit(KNOWN, code)
    record["patients"][0]["fit"] = {"values": [list(each) for each in fit.values], "code": list(fit.code)}


_state = partial(_set, "state")
_patient = partial(_set, "patients", 0)
_FAR = 1e300

CASES = (
    _bytes("as it is", ending="success"),
    _bytes("lines of Windows", damage.replaced(b"\n", b"\r\n"), ending="success"),
    _bytes("a mark", damage.begun_with(b"\xef\xbb\xbf"), ending="either"),
    _bytes("UTF-16", damage.encoded("utf-16"), ending="either"),
    *(_bytes(f"cut at {share}", damage.cut(share)) for share in (0.05, 0.35, 0.6, 0.95)),
    *(_bytes(f"flips {turn}", damage.flip(3), ending="either") for turn in "abcdefgh"),
    *(_bytes(f"swapped blocks {turn}", damage.swap(24), ending="either") for turn in "abcd"),
    *(_bytes(f"a hole {turn}", damage.hole(16), ending="either") for turn in "ab"),
    _bytes("zeros inside", damage.zeros(64)),
    _bytes("twice", damage.doubled),
    _bytes("more behind", damage.ended_with(b"}")),
    _bytes("nesting", lambda *_: b"[" * 50_000),
    *(_bytes(what, lambda *_, content=content: content) for what, content in damage.STRANGERS.items()),
    _beside("no atlas", "refused", eggs_safetensors=None),
    _beside("a mesh for the atlas", "refused", eggs_safetensors=shapes.stl(shapes.triangles())),
    _beside("a folder for the atlas", "refused", eggs_safetensors=Special.FOLDER),
    _beside("no scan", "success", "left out", egg_stl=None),
    _beside("an empty scan", "success", "left out", egg_stl=b""),
    _beside("a web page for the scan", "success", "left out", egg_stl=damage.STRANGERS["a web page"]),
    _beside("a pipe for the scan", "success", "left out", egg_stl=Special.PIPE),
    _record("another atlas was meant", _set("atlas", "sha256", to="0" * 64), "success"),
    _record("no hash", _set("atlas", "sha256", to=""), "success"),
    _record("an atlas that is a number", _set("atlas", "path", to=7)),
    _record("an atlas with a null in its name", _set("atlas", "path", to="a\0b")),
    _record("a very long name", _set("atlas", "path", to="a" * 5000)),
    _record("the folder for the atlas", _set("atlas", "path", to=".")),
    _record("a format of somebody", _set("format", to="somebody's")),
    _record("a version of tomorrow", _set("version", to=99)),
    _record("a version in words", _set("version", to="one")),
    _record("no state", _set("state", to=None)),
    _record("no patients", _set("patients", to=[]), "either"),
    _record("a patient twice", lambda record: record["patients"].append(record["patients"][0]), "either"),
    _record("more than is known", _set("weather", to="fine"), "success"),
    *(
        _record(f"values {values}", _state("values", to=values))
        for values in ([], [6.0], [6.0, 1.0, 2.0], [_FAR, 1.0], [6.0, "M"], [None, 1.0], "61", [True, 1.0])
    ),
    _record("a layout of tomorrow", _state("layout", to="globe")),
    _record("the layout of a change without a patient to compare", _state("layout", to="change"), "either"),
    _record("a patient that is nobody", _state("patient", to=7), "success"),
    _record("compared with nobody", _state("compared", to=9), "success"),
    _record("muted strangers", _state("muted", to=["weight", "sex", "sex"]), "success"),
    _record("touched a stranger", _state("touched", to="weight"), "success"),
    *(
        _record(f"a pin {what}", _state("pins", to=[{"number": number, "origin_mm": place}]), "either")
        for what, number, place in (
            ("far away", 1, [_FAR, 0.0, 0.0]),
            ("of two numbers", 1, [0.0, 1.0]),
            ("of number -1", -1, [0.0, 0.0, 0.0]),
            ("of number 10^12", 10**12, [0.0, 0.0, 0.0]),
        )
    ),
    _record("a hundred pins", lambda record: _hundredfold(record["state"], "pins"), "either"),
    *(
        _record(
            f"a scale that ends at {limit}",
            _state("overlay", "limits", to=[["mm per year", limit]]),
            "either",
        )
        for limit in (0.0, -1.0, 1e-300, _FAR)
    ),
    _record("a map of tomorrow", _state("overlay", "quantity", to="temperature")),
    _record(
        "axes of strangers", _state("support", to={"x": "length", "y": "width", "is_open": True}), "either"
    ),
    _record("a curve of strangers", _state("curve", to={"measure": "weight", "covariate": "x"}), "either"),
    *(
        _record(f"a camera {what}", _set("camera", key, to=to), "either")
        for what, key, to in (
            ("without up", "up", [0.0, 0.0, 0.0]),
            ("at what it looks at", "position_mm", [0.0, 0.0, 0.0]),
            ("that looks along up", "up", [0.0, 1.0, 0.0]),
            ("far away", "position_mm", [_FAR, 0.0, 0.0]),
            ("of zoom 0", "zoom", 0.0),
            ("of zoom -1", "zoom", -1.0),
            ("of zoom 1e300", "zoom", _FAR),
            ("of no extent", "framed_mm", [0.0, 0.0]),
        )
    ),
    _record("no camera", _set("camera", to=None), "success"),
    *(
        _record(f"a window of {size}", _set("window_px", to=size), "either")
        for size in ([0, 0], [-5, 10], [10**9, 10**9])
    ),
    *(
        _record(f"a scan of label {label!r}", _patient("reading", "label", to=label), "either")
        for label in (-1, 10**20, "egg", "")
    ),
    *(
        _record(f"a scan to scale {scale}", _patient("reading", "scale", to=scale), "either")
        for scale in (0.0, -1.0, 1e-300, _FAR)
    ),
    _record("a scan aligned by magic", _patient("reading", "align", to="magic"), "either"),
    _record(
        "a scan aligned by landmarks that are gone", _patient("reading", "landmarks", to="lm.csv"), "either"
    ),
    _record("known strangers", _patient("known", to=[["weight", 3.0]]), "either"),
    _record("known out of range", _patient("known", to=[["age", _FAR]]), "either"),
    _record("the atlas as a scan", _patient("reading", "path", to=ATLAS), "success"),
    _record("the session as a scan", _patient("reading", "path", to=FILE), "success"),
    _record("a fit that was another", partial(_fitted, (0.5, -0.5)), "success"),
    _record("a code of one number", partial(_fitted, (0.5,)), "success"),
)


def _hundredfold(record: Record, key: str) -> None:
    record[key] = record[key] * 100
