"""Describe what a figure was measured on: the machine, and the versions of the software."""

from __future__ import annotations

import math
import os
import platform
from importlib.metadata import PackageNotFoundError, version

from crowdsim.processors import usable_processors

PACKAGES = tuple(
    (
        "numpy numba shapely triangle trimesh pyvista scipy pydantic ruamel.yaml typer rich h5py pybvh av matplotlib"
    ).split()
)
"""Packages that crowdsim depends on."""


def describe_machine() -> dict[str, str | int]:
    """Return processor, cores available to this process, and operating system."""
    return {
        "processor": _processor(),
        "cores": usable_processors(),
        "system": platform.platform(),
    }


def load_average() -> float:
    """Return how many programs wanted a processor in the last minute, on average; nan if the system does not count."""
    return os.getloadavg()[0] if hasattr(os, "getloadavg") else math.nan


def describe_versions() -> dict[str, str]:
    """Return the versions of crowdsim, Python and each dependency; ``"missing"`` if it is not installed."""
    from crowdsim.version import __version__

    return {
        "crowdsim": __version__,
        "python": platform.python_version(),
        **{name: _version(name) for name in PACKAGES},
    }


def _version(name: str) -> str:
    """Return the version of a package, or ``"missing"``."""
    try:
        return version(name)
    except PackageNotFoundError:
        return "missing"


def _processor() -> str:
    """Return the name of the processor, as Linux or else the platform has it."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as lines:
            for line in lines:
                if line.startswith("model name"):
                    return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()
