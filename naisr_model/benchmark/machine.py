"""The machine and the libraries that figures were measured on."""

from __future__ import annotations

import math
import os
import platform
from importlib import metadata
from pathlib import Path
from typing import Any

from naisr_model import __version__


def machine() -> dict[str, Any]:
    """What this was measured on: ``processor``, ``cores``, ``memory_gb`` and ``system``."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "memory_gb": _memory_bytes() / 2**30,
        "system": platform.platform(),
    }


def versions() -> dict[str, str]:
    """Versions of everything that has a say in the figures."""
    packages = {"torch": "torch", "vtk": "vtk", "pyvista": "pyvista", "PySide6": "PySide6-Essentials"}
    return {
        "naisr": __version__,
        "python": platform.python_version(),
        **{name: metadata.version(package) for name, package in packages.items()},
    }


def _processor() -> str:
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text().splitlines() if cpuinfo.exists() else []
    named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(named, platform.processor() or platform.machine())


def _memory_bytes() -> float:
    try:
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, ValueError):
        return math.nan
