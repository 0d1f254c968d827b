"""Everything that a recording holds, read as playback and measurements do, and value by value."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from crowdsim.recording.header import RecordedFrame
from crowdsim.recording.reader import Recording


def read_all(path: Path) -> None:
    """Read everything of a recording that a film, a picture or a measurement may use.

    Nothing is returned: what counts is whether reading raises an error, a CrowdSimError if the damage is noticed.
    """
    with Recording.open(path) as recording:
        for time in np.linspace(0.0, recording.duration, 8).tolist():
            recording.at_time(time)
            recording.poses_at(time)
            recording.paths_at(time)
            recording.movables_at(time)
        _ = recording.switches, recording.most_present, recording.changes, recording.complete
        _ = recording.measured, recording.paths, recording.levels[:], recording.state_hash[:], recording.commands
        _ = recording.agent_times
        for name in RecordedFrame._fields:
            getattr(recording, name)[:]
        for agent in range(recording.agent_count):
            recording.stay(agent)


def all_values(path: Path) -> dict[str, tuple[Any, ...]]:
    """Return type, shape and values of each dataset and attribute of an HDF5 file, by name."""
    found: dict[str, tuple[Any, ...]] = {}

    def add(name: str, value: Any) -> None:
        """Note a value; bytes compare nan as equal, but those of objects (texts) would be addresses."""
        values = np.asarray(value)
        content = values.tolist() if values.dtype == object else values.tobytes()
        found[name] = (str(values.dtype), values.shape, content)

    def visit(name: str, item: Any) -> None:
        """Note a dataset or a group with its attributes."""
        if isinstance(item, h5py.Dataset):
            add(name, item[()])
        for key, value in item.attrs.items():
            add(f"{name}.{key}", value)

    with h5py.File(path, "r", locking=False) as file:
        visit("", file)
        file.visititems(visit)
    return found
