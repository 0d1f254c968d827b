"""Read occupancy maps of robots: an image, and a .yaml with its position."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label

from crowdsim.errors import CrowdSimError


class LaserMap(NamedTuple):
    """Centers (n, 2) of cells [m]; unknown cells are left out."""

    occupied: NDArray[np.float64]
    free: NDArray[np.float64]
    seen: NDArray[np.float64]
    """Free cells of the largest connected area. Others, such as those inside walls, no robot can have seen."""


def read_laser_map(file: Path) -> LaserMap:
    """Read the .yaml and the binary .pgm beside it; raise CrowdSimError if they have another format."""
    try:
        said = dict(re.findall(r"^(\w+):\s*(.*?)\s*$", file.read_text(encoding="utf-8"), re.MULTILINE))
        content = (file.parent / said["image"]).read_bytes()
        header = re.match(rb"P5\s+(?:#[^\n]*\n\s*)*(\d+)\s+(\d+)\s+255\s", content)
        if header is None:
            raise ValueError("the image is no binary PGM")
        columns, rows = int(header[1]), int(header[2])
        shades = np.frombuffer(content, np.uint8, rows * columns, header.end()).reshape(rows, columns)
        # As ROS' map_server reads maps: dark is occupied, unless they are negated; what is between is unknown.
        occupancy = shades / 255.0 if int(said["negate"]) else 1.0 - shades / 255.0
        cell = float(said["resolution"])
        x0, y0 = (float(number) for number in said["origin"].strip("[]").split(",")[:2])
        x = x0 + (np.arange(columns) + 0.5) * cell
        y = y0 + (rows - 0.5 - np.arange(rows)) * cell  # row 0 of the image is at the top
        centers = np.stack(np.meshgrid(x, y), axis=-1)
        occupied = occupancy > float(said["occupied_thresh"])
        free = occupancy < float(said["free_thresh"])
        pieces, _ = label(free)  # numbers of connected areas
        largest = np.bincount(pieces[free]).argmax() if free.any() else 0
        return LaserMap(centers[occupied], centers[free], centers[free & (pieces == largest)])
    except (OSError, ValueError, KeyError) as error:
        raise CrowdSimError(f"{file}: is no map of a robot ({type(error).__name__}: {error})") from None
