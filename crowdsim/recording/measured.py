"""What was measured at lines and in areas, as a recording holds it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

GROUP = "measured"


@dataclass(frozen=True)
class AreaSeries:
    """An area of ``size`` [m2] of free floor, in every step: count (steps,) int32 of those in it, and their mean speed
    (steps,) float32 [m/s], nan where it is not known of anybody."""

    size: float
    count: NDArray[np.int32]
    speed: NDArray[np.float32]


@dataclass(frozen=True)
class Crossings:
    """Who crossed a line of ``length`` [m], in the order of their times: agent (c,) int32, time (c,) [s], and to_left
    (c,) bool, whether to the left of who goes from its first point to its last."""

    length: float
    agent: NDArray[np.int32]
    time: NDArray[np.float64]
    to_left: NDArray[np.bool_]


@dataclass(frozen=True)
class Measured:
    """All areas and lines of a run, by their names."""

    areas: dict[str, AreaSeries] = field(default_factory=dict)
    lines: dict[str, Crossings] = field(default_factory=dict)


def write_measured(file: h5py.File, measured: Measured) -> None:
    """Add what was measured to a recording; nothing if there is nothing."""
    for kind, places in (("areas", measured.areas), ("lines", measured.lines)):
        for number, (name, place) in enumerate(places.items()):
            group = file.create_group(f"{GROUP}/{kind}/{number}")
            group.attrs["name"] = name
            for key, value in vars(place).items():
                if isinstance(value, float):
                    group.attrs[key] = value
                else:
                    group.create_dataset(key, data=value, compression="gzip" if len(value) else None)


def read_measured(file: h5py.File) -> Measured:
    """What was measured in a recording; empty of one that has none."""
    measured = Measured()
    if GROUP not in file:
        return measured

    def groups(kind: str) -> list[Any]:
        found = file[GROUP].get(kind, {})
        return [found[key] for key in sorted(found, key=int)]

    for group in groups("areas"):
        size = float(group.attrs["size"])
        measured.areas[str(group.attrs["name"])] = AreaSeries(size, group["count"][:], group["speed"][:])
    for group in groups("lines"):
        length, columns = float(group.attrs["length"]), (group[key][:] for key in ("agent", "time", "to_left"))
        measured.lines[str(group.attrs["name"])] = Crossings(length, *columns)
    return measured
