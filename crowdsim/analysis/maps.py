"""Maps of density, speed, and the last time that a cell is not empty, by PedPy."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.analysis.drawing import floor_panels, outline
from crowdsim.analysis.pedpy_library import pandas, pedpy
from crowdsim.analysis.results import Places, Result
from crowdsim.analysis.tracks import Tracks

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CELL = 0.5
"""Side of a cell of the maps by default [m]."""

MOST_CELLS = 6_000
"""Number of cells of side CELL above which larger ones are taken."""

MOST_FRAMES = 400
"""Number of frames that maps of density and speed are means of, at most."""

Floats = NDArray[np.float64]


def measure_maps(tracks: Tracks, places: Places) -> Result:
    """Return mean density [1/m2] and speed [m/s] in each cell, and the last time that it is not empty [s].

    Cells that are always empty are left out of the table.
    """
    name, title = "maps", "Density, speed, and longest time to leave"
    if tracks.trajectory is None:
        return Result(name, title, {}, ("Nobody was present: there is nothing to measure.",))
    floor = pedpy.AxisAlignedMeasurementArea(*tracks.recording.walkable().bounds)
    low_x, low_y, high_x, high_y = floor.bounds
    # A whole multiple of CELL with which at most about MOST_CELLS cover the floor.
    cell = CELL * max(1.0, float(np.ceil(np.sqrt((high_x - low_x) * (high_y - low_y) / (CELL * CELL) / MOST_CELLS))))
    count = tracks.frames
    # Density and speed are means of at most MOST_FRAMES frames, one in `every`.
    every = max(-(-count // MOST_FRAMES), 1)
    rows = tracks.table[tracks.table["frame"] % every == 0]
    if not len(rows):  # nobody was there in these frames, but in others
        every, rows = 1, tracks.table
    grid = {"grid_size": cell, "axis_aligned_measurement_area": floor}
    with np.errstate(divide="ignore", invalid="ignore"):
        present = pedpy.compute_density_profile(
            data=rows[["id", "frame", "x", "y"]], density_method=pedpy.DensityMethod.CLASSIC, **grid
        )
        moving = rows[rows["speed"].notna()]
        speeds = pedpy.compute_speed_profile(
            data=moving[["id", "frame", "x", "y", "speed"]], speed_method=pedpy.SpeedMethod.MEAN, **grid
        )
    # PedPy gives a map for each frame that is not empty; the mean density counts empty frames, too. The speed of an
    # empty cell is nan.
    density = np.sum(present, axis=0) / len(range(0, count, every))
    known = np.isfinite(speeds).sum(axis=0) if len(speeds) else np.zeros(density.shape, np.int64)
    total = np.nansum(speeds, axis=0) if len(speeds) else np.zeros(density.shape)
    # The maximum only avoids a division by 0 in empty cells.
    speed = np.where(known > 0, total / np.maximum(known, 1), np.nan)
    last = pedpy.compute_rset_map(traj_data=tracks.trajectory, method=pedpy.RsetMethod.MAX, **grid)
    values: dict[str, Any] = {
        "cell": cell,
        "density_most": float(density.max()),
        "speed_least": float(np.nanmin(speed)) if known.any() else None,
        "last": float(np.nanmax(last)),
    }
    sentences = (
        f"Cells of {cell:g} m. Density is the mean over the whole run, {density.max():.2f} /m2 at most; speed is the "
        "mean over the moments in which the cell is not empty; the time is the last of these (RSET map).",
    )
    # Centers of cells. PedPy's bins begin at the lower left corner, and its first row is the uppermost one.
    rows_down, columns = density.shape
    x = low_x + cell * (np.arange(columns) + 0.5)
    y = low_y + cell * (rows_down - 0.5 - np.arange(rows_down))
    across, down = np.meshgrid(x, y)
    table = pandas.DataFrame(
        {
            "x": across.ravel(),
            "y": down.ravel(),
            "density": density.ravel(),
            "speed": speed.ravel(),
            "last": last.ravel(),
        }
    )
    table = table[(table.density > 0.0) | table["last"].notna()]
    extent = (low_x, low_x + cell * columns, low_y, low_y + cell * rows_down)
    shown = (
        ("mean density [1/m²]", np.where(density > 0.0, density, np.nan), "viridis"),
        ("mean speed [m/s]", speed, "cividis"),
        ("last time that people are there [s]", last, "magma_r"),
    )

    def draw(figure: Figure) -> None:
        """Draw three maps: density, speed, and the last time that people are there."""
        walkable = tracks.recording.walkable()
        for axes, (label, values_shown, shades) in zip(floor_panels(figure, walkable, 3), shown, strict=True):
            image = axes.imshow(values_shown, extent=extent, cmap=shades, origin="upper", vmin=0.0)
            figure.colorbar(image, ax=axes, shrink=0.85, pad=0.02)
            outline(axes, walkable, places)
            axes.set_title(label, fontsize="medium")

    return Result(name, title, values, sentences, table, draw)
