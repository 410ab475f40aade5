"""Sessions on disk: one JSON, its paths counted from where it is as far as they lie beneath."""

from __future__ import annotations

import json
import os
from pathlib import Path
from reprlib import repr as shortened
from typing import Any

import numpy as np
from cattrs import ClassValidationError, Converter, transform_error
from cattrs.gen import make_dict_structure_fn, make_dict_unstructure_fn, override

from naisr_model.errors import InputError
from naisr_model.files import replacing, require_file
from naisr_model.records import entry, parsed
from naisr_viewer import __version__
from naisr_viewer.state.camera import Camera
from naisr_viewer.state.explorer import ExplorerState
from naisr_viewer.state.overlay import Overlay
from naisr_viewer.state.section import Section
from naisr_viewer.state.session import Session

FORMAT, VERSION = "NAISR session", 1
ENDING = ".json"
LARGEST_BYTES = 20_000_000
"""No session is as large."""

BESIDE = ("atlas", "patients", "has_norms", "is_atlas_changed")
"""Of a state: what the session has elsewhere, or what is found again."""

LARGEST_NUMBER = 1e12
"""No covariate, length or number of a code is as large; single precision can still square it."""

LONGEST_NAME, LONGEST_PATH = 255, 4096
"""Bytes; no file has a longer one."""

ALONG_UP = 1e-6
"""A sine below which a camera looks along what is up."""


def write_session(session: Session, path: Path) -> None:
    """Write a session, whole or not at all.

    Raises:
        InputError: when it cannot be written.
    """
    record = {
        "format": FORMAT,
        "version": VERSION,
        "program": __version__,
        **_converter(path.parent).unstructure(session),
    }
    text = json.dumps(record, indent=1, ensure_ascii=False, allow_nan=False)
    with replacing(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")


def read_session(path: Path) -> Session:
    """Read a session; that its files are there, and fit it, is for who opens them to see.

    Raises:
        InputError: when the file is none, is damaged, or of a newer program.
    """
    require_file(path, f"a session ({ENDING})")
    try:
        return _converter(path.parent).structure(_record(path), Session)
    except ClassValidationError as error:
        found = transform_error(error, path="session")[0]
        raise InputError(f"{path.name} is a damaged session: {found}; save it again") from error


def _record(path: Path) -> dict[str, Any]:
    none = InputError(f"{path.name} is no session; choose one that File > Save session… has written")
    try:
        if path.stat().st_size > LARGEST_BYTES:
            raise none
        record = parsed(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror or error}") from error
    except ValueError as error:  # neither text nor JSON
        raise none from error
    if record.get("format") != FORMAT:
        raise none
    try:
        version = entry(record, "version", int)
    except ValueError as error:
        raise none from error
    if version > VERSION:
        raise InputError(f"{path.name} was written by a newer program; update this one to open it")
    return record


def _converter(folder: Path) -> Converter:
    """Frozen values to records and back; what is no field of theirs is left aside."""
    converter = Converter()
    converter.register_structure_hook(Path, lambda text, _: _path(text, folder))
    converter.register_structure_hook(float, lambda value, _: _number(value))
    converter.register_structure_hook(int | str | None, lambda value, _: _label(value))
    as_camera = make_dict_structure_fn(Camera, converter)  # by what is registered so far, as all below
    converter.register_structure_hook(Camera, lambda value, kind: _sound_camera(as_camera(value, kind)))
    as_overlay = make_dict_structure_fn(Overlay, converter)
    converter.register_structure_hook(Overlay, lambda value, kind: _sound_overlay(as_overlay(value, kind)))
    as_section = make_dict_structure_fn(Section, converter)
    converter.register_structure_hook(Section, lambda value, kind: _sound_section(as_section(value, kind)))
    absent: dict[str, Any] = dict.fromkeys(BESIDE, override(omit=True))
    as_state = make_dict_structure_fn(ExplorerState, converter, **absent)
    converter.register_structure_hook(ExplorerState, lambda value, kind: as_state(_record_of(value), kind))
    converter.register_unstructure_hook(Path, lambda path: _beneath(path, folder))
    converter.register_unstructure_hook(
        ExplorerState, make_dict_unstructure_fn(ExplorerState, converter, **absent)
    )
    return converter


def _beneath(path: Path, folder: Path) -> str:
    """A path for who has the session: counted from its folder where it lies beneath, whole elsewhere."""
    path, folder = path.absolute(), folder.absolute()
    return path.relative_to(folder).as_posix() if path.is_relative_to(folder) else str(path)


def _path(text: object, folder: Path) -> Path:
    if not isinstance(text, str) or not text or "\0" in text:
        raise ValueError(f"{shortened(text)} is no path")
    path = folder.absolute() / text
    if len(os.fsencode(path)) > LONGEST_PATH or max(map(len, map(os.fsencode, path.parts))) > LONGEST_NAME:
        raise ValueError(f"{shortened(text)} is too long for a path")
    return path


def _sound_camera(camera: Camera) -> Camera:
    """One that sees something."""
    along = np.subtract(camera.focus_mm, camera.position_mm)
    crossed = np.linalg.norm(np.cross(along, camera.up))
    if not crossed > ALONG_UP * np.linalg.norm(along) * np.linalg.norm(camera.up):
        raise ValueError("a camera that looks along what is up, or nowhere, sees nothing")
    if not (camera.zoom > 0 and min(camera.framed_mm) > 0):
        raise ValueError("a camera sees nothing of what has no size")
    return camera


def _sound_overlay(overlay: Overlay) -> Overlay:
    if not all(limit > 0 for _, limit in overlay.limits):
        raise ValueError("a colour scale ends beyond 0")
    return overlay


def _sound_section(section: Section) -> Section:
    if abs(np.linalg.norm(section.normal) - 1) > ALONG_UP:
        raise ValueError("the normal of a plane has the length 1")
    return section


def _record_of(value: object) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise ValueError(f"{shortened(value)} is no record")
    return value


def _label(value: object) -> int | str | None:
    if isinstance(value, bool) or not isinstance(value, int | str | None):
        raise ValueError(f"{value!r} is no label")
    return value


def _number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < LARGEST_NUMBER:
        raise ValueError(f"{shortened(value)} is no number of a session")
    return float(value)
