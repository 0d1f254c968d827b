"""Measurements at lines and in areas, as a recording holds them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from crowdsim.recording.storage.values import PACKED, values_of

GROUP = "measured"
"""Group of the file that holds the measurements."""

LEAST_CROSSINGS = 20
"""Number of crossings below which a line has no flow: too few for a mean."""


@dataclass(frozen=True)
class AreaSeries:
    """Measurements in an area, in every step.

    Attributes
    ----------
    size : float
        Area of the free floor [m2].
    count : (steps,) int32
        Number of agents inside.
    speed : (steps,) float32
        Their mean speed [m/s]; nan if no speed is known.
    """

    size: float
    count: NDArray[np.int32]
    speed: NDArray[np.float32]


@dataclass(frozen=True)
class Crossings:
    """Crossings of a line, in the order of time.

    Attributes
    ----------
    length : float
        Length of the line [m].
    width : float
        Length of its part on the free floor, by which a flow for each meter is divided [m]; nan in older files.
    agent : (c,) int32
        Agent that crossed.
    time : (c,) float64
        Time of the crossing [s].
    to_left : (c,) bool
        Whether it crossed to the left side, seen along the line from its first point to its last.
    """

    length: float
    width: float
    agent: NDArray[np.int32]
    time: NDArray[np.float64]
    to_left: NDArray[np.bool_]


@dataclass(frozen=True)
class Measured:
    """All areas and lines of a run, by name."""

    areas: dict[str, AreaSeries] = field(default_factory=dict)
    lines: dict[str, Crossings] = field(default_factory=dict)


def write_measured(file: h5py.File, measured: Measured) -> None:
    """Add measurements to a recording; do nothing if there are none."""
    for kind, places in (("areas", measured.areas), ("lines", measured.lines)):
        for number, (name, place) in enumerate(places.items()):
            group = file.create_group(f"{GROUP}/{kind}/{number}")
            group.attrs["name"] = name
            for key, value in vars(place).items():
                # Single numbers are attributes, columns are datasets.
                if isinstance(value, float):
                    group.attrs[key] = value
                else:
                    group.create_dataset(key, data=value, **(PACKED if len(value) else {}))


def read_measured(file: h5py.File) -> Measured:
    """Return the measurements of a recording; empty if it has none."""
    measured = Measured()
    if GROUP not in file:
        return measured

    def groups(kind: str) -> list[Any]:
        """Return the groups of a kind (areas or lines) in the order of their numbers, which are their names."""
        found = file[GROUP].get(kind, {})
        return [found[key] for key in sorted(found, key=int)]

    for group in groups("areas"):
        size = float(group.attrs["size"])
        measured.areas[str(group.attrs["name"])] = AreaSeries(
            size, values_of(group, "count"), values_of(group, "speed")
        )
    for group in groups("lines"):
        length, width = float(group.attrs["length"]), float(group.attrs.get("width", np.nan))
        columns = (values_of(group, key) for key in ("agent", "time", "to_left"))
        measured.lines[str(group.attrs["name"])] = Crossings(length, width, *columns)
    return measured


def flow_of(times: NDArray[np.float64]) -> float | None:
    """Return the flow [1/s] of crossings at ascending times [s].

    It is counted between the first and the last tenth of the crossings, without the few that come early or late. None
    if there are fewer than LEAST_CROSSINGS, or if those that are counted all happen at one time.
    """
    few = len(times) // 10
    if len(times) < LEAST_CROSSINGS or times[-few - 1] <= times[few]:
        return None
    # One interval less than crossings.
    return float((len(times) - 2 * few - 1) / (times[-few - 1] - times[few]))
