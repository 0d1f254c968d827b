"""crowdsim: characters that walk through cluttered places as people do."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from crowdsim.version import __version__ as __version__

if TYPE_CHECKING:
    from crowdsim.crowd.simulation import Simulation
    from crowdsim.errors import CrowdSimError, PathNotFound, ScenarioError
    from crowdsim.navmesh.navmesh import NavMesh
    from crowdsim.recording.reader import Recording
    from crowdsim.scenario.loader import load_scenario

_HOMES = {
    "CrowdSimError": "crowdsim.errors",
    "NavMesh": "crowdsim.navmesh.navmesh",
    "PathNotFound": "crowdsim.errors",
    "Recording": "crowdsim.recording.reader",
    "ScenarioError": "crowdsim.errors",
    "Simulation": "crowdsim.crowd.simulation",
    "load_scenario": "crowdsim.scenario.loader",
}

__all__ = ["CrowdSimError", "NavMesh", "PathNotFound", "Recording", "ScenarioError", "Simulation", "load_scenario"]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'crowdsim' has no attribute '{name}'")
    return getattr(importlib.import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
