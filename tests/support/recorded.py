"""Runs of library scenarios that several test files use; each is made once, by the first test that needs it."""

from __future__ import annotations

import hashlib
from pathlib import Path

from crowdsim.crowd.simulation import Simulation
from crowdsim.scenario.loader import load_scenario

try:
    import fcntl
except ImportError:  # without file locks, two processes may make the same run
    fcntl = None


class Recorded:
    """Recordings in a folder that all processes of a test session share."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def __call__(self, name: str, *changes: str) -> Path:
        """Return the recording of ``name``, run to its end with two workers."""
        chosen = hashlib.sha256("\n".join(changes).encode()).hexdigest()[:8] if changes else "as-it-is"
        file = self._folder / f"{name}-{chosen}.h5"
        with open(file.with_suffix(".lock"), "w") as lock:
            if fcntl is not None:
                fcntl.flock(lock, fcntl.LOCK_EX)
            if not file.exists():
                Simulation(load_scenario(name, changes), workers=2).run(file).close()
        return file
