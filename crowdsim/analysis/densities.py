"""Density and speed in areas, by PedPy: the fundamental diagram beside people, and levels of service."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from crowdsim.analysis.drawing import BAND, COLORS, color, legend, panels
from crowdsim.analysis.measured_people import (
    ONE_WAY_SOURCE,
    ONE_WAY_SPEEDS,
    QUEUES,
    WALKWAYS,
    WEIDMANN_SOURCE,
    ServiceTable,
    weidmann_speed,
)
from crowdsim.analysis.pedpy_library import pandas, pedpy
from crowdsim.analysis.results import Places, Result
from crowdsim.analysis.tracks import Tracks

if TYPE_CHECKING:
    from matplotlib.figure import Figure

VORONOI_RATE = 2.0
"""Number of times a second at which areas are measured [1/s]."""

MOST_VORONOI_ROWS = 40_000
"""Number of agents, summed over frames, above which fewer frames are measured: each cell takes PedPy about 0.2 ms."""

LEAST_VORONOI = 0.6
"""Density below which the classic method counts [1/m2]: Voronoi cells of thin crowds reach far beyond the area."""

LEVELS = "ABCDEF"
"""Fruin's levels of service, from the most space for each person to the least."""


class Measured(NamedTuple):
    """What was measured in areas.

    Attributes
    ----------
    table : pandas.DataFrame
        A row for each area and frame in which it is not empty: area, time [s], density_classic, density_voronoi,
        density [1/m2], speed_classic, speed_voronoi, speed [m/s]. The classic density counts centers in the area;
        density and speed are classic if it is below LEAST_VORONOI or no cell is known, else of Voronoi cells.
    sentences : tuple of str
        What a reader has to know.
    """

    table: pandas.DataFrame
    sentences: tuple[str, ...]


COLUMNS = ("area", "time", "density_classic", "density_voronoi", "density", "speed_classic", "speed_voronoi", "speed")


def measure_areas(tracks: Tracks, places: Places, voronoi_rate: float = VORONOI_RATE) -> Measured:
    """Measure density and speed in all areas, about ``voronoi_rate`` times a second [1/s], once a frame at most.

    Only frames in which an area is not empty are measured; some of these are skipped if more than MOST_VORONOI_ROWS
    agents would be measured in all. Areas that are not convex are left out, which a sentence says.
    """
    empty = pandas.DataFrame({column: [] for column in COLUMNS})
    if not places.areas:
        return Measured(empty, ("There is no area: name one under `areas` of the scenario or by --area.",))
    usable, sentences = _usable(tracks, places)
    if tracks.trajectory is None or not usable:
        return Measured(empty, (*sentences, "Nobody was in an area."))
    every = max(1, round(tracks.rate / voronoi_rate))
    # Measure frames in which an area is not empty, one in `every`, and fewer if too many people are in them.
    rows = tracks.table[tracks.table["frame"] % every == 0]
    inside = np.zeros(len(rows), np.bool_)
    for area in usable.values():
        inside |= shapely.contains_xy(area.polygon, rows[["x", "y"]].to_numpy())
    busy = np.unique(rows["frame"].to_numpy()[inside])
    if not len(busy):
        return Measured(empty, (*sentences, "Nobody was in an area."))
    rows = rows[rows["frame"].isin(busy)]
    thinned = -(-len(rows) // MOST_VORONOI_ROWS)  # rounded up
    if thinned > 1:
        busy = busy[::thinned]
        rows = rows[rows["frame"].isin(busy)]
        sentences.append(f"One in {thinned} of these moments is measured, as there are many people.")
    part = pedpy.TrajectoryData(rows[["id", "frame", "x", "y"]].reset_index(drop=True), frame_rate=float(tracks.rate))
    speeds = tracks.speeds.merge(rows[["id", "frame"]], on=["id", "frame"])
    cells = _cells(tracks, part)
    parts = []
    for name, area in usable.items():
        table = _measure(name, area, tracks, part, speeds, cells)
        parts.append(table[places.areas[name].during(table["time"].to_numpy())])
    return Measured(pandas.concat(parts, ignore_index=True), (*sentences,))


def _usable(tracks: Tracks, places: Places) -> tuple[dict[str, pedpy.MeasurementArea], list[str]]:
    """Return the areas that PedPy takes, the convex ones, and sentences on their times, other areas, and obstacles."""
    usable, sentences = {}, []
    free = tracks.recording.walkable()
    for name, place in places.areas.items():
        area = place.shape
        if place.times_in_words:
            sentences.append(f"{name} is measured{place.times_in_words}.")
        # A circle is a polygon of many corners, whose last bits are not convex.
        hull = area.convex_hull
        if hull.area - area.area > 1e-6 * area.area:
            sentences.append(f"{name} is not convex, and PedPy takes convex areas only: cut it into several.")
            continue
        share = area.intersection(free).area / area.area
        if share < 0.99:
            sentences.append(
                f"{name}: {share:.0%} of it is free floor; PedPy divides by the whole, so that densities are low."
            )
        usable[name] = pedpy.MeasurementArea(hull)
    return usable, sentences


def _cells(tracks: Tracks, part: pedpy.TrajectoryData) -> pandas.DataFrame:
    """Return PedPy's Voronoi cells of all agents on the part of the floor that PedPy knows, see ``Tracks.walkable``."""
    on_floor = shapely.contains_xy(tracks.walkable, part.data[["x", "y"]].to_numpy())
    known = pedpy.TrajectoryData(part.data.loc[on_floor, ["id", "frame", "x", "y"]], frame_rate=part.frame_rate)
    return pedpy.compute_individual_voronoi_polygons(traj_data=known, walkable_area=pedpy.WalkableArea(tracks.walkable))


def _measure(
    name: str,
    area: pedpy.MeasurementArea,
    tracks: Tracks,
    part: pedpy.TrajectoryData,
    speeds: pandas.DataFrame,
    cells: pandas.DataFrame,
) -> pandas.DataFrame:
    """Measure one area in the frames in which it is not empty; return its rows of :class:`Measured`.

    ``part`` holds the tracks in the frames to measure, ``speeds`` PedPy's speeds there, ``cells`` the Voronoi cells.
    """
    table = pedpy.compute_classic_density(traj_data=part, measurement_area=area)
    table = table[table["density"] > 0.0].rename(columns={"density": "density_classic"})
    mean = pedpy.compute_mean_speed_per_frame(traj_data=part, individual_speed=speeds, measurement_area=area)
    table = table.merge(mean.rename(columns={"speed": "speed_classic"}), on="frame", how="left")
    if len(cells):
        density, shares = pedpy.compute_voronoi_density(individual_voronoi_data=cells, measurement_area=area)
        shares = shares[shares["intersection"].notna()]  # cells that reach into the area
        speed = pedpy.compute_voronoi_speed(
            traj_data=part, individual_speed=speeds, individual_voronoi_intersection=shares, measurement_area=area
        )
        table = table.merge(density.rename(columns={"density": "density_voronoi"}), on="frame", how="left")
        table = table.merge(speed.rename(columns={"speed": "speed_voronoi"}), on="frame", how="left")
    else:
        table["density_voronoi"] = table["speed_voronoi"] = np.nan
    dense = (table["density_classic"] >= LEAST_VORONOI) & table["density_voronoi"].notna()
    for kind in ("density", "speed"):
        table[kind] = np.where(dense, table[f"{kind}_voronoi"], table[f"{kind}_classic"])
    table["area"], table["time"] = name, tracks.time(table["frame"].to_numpy())
    return table[list(COLUMNS)]


def fundamental_diagram(measured: Measured, _: Tracks) -> Result:
    """Return speed and flow over density in the areas, beside measurements of people; no values if nothing is known."""
    name, title = "diagram", "Fundamental diagram"
    table = measured.table
    values: dict[str, Any] = {}
    if not len(table):
        return Result(name, title, values, measured.sentences)
    sentences = list(measured.sentences)
    for area, rows in table.groupby("area", sort=False):
        values[str(area)] = {
            "moments": len(rows),
            "density_mean": float(rows.density.mean()),
            "density_most": float(rows.density.max()),
            "speed_mean": float(rows.speed.mean()),
            "at_density": _by_density(rows),
        }
        sentences.append(
            f"{area}: {rows.density.mean():.2f} /m2 ({rows.density.max():.2f} at most), {_in_words(rows.speed.mean())} "
            f"while it is not empty."
        )
    sentences.append(
        f"Below {LEAST_VORONOI:g} /m2 the classic method counts, above it Voronoi cells. Curve: {WEIDMANN_SOURCE}. "
        f"Band: 5 to 95 % of speeds in {ONE_WAY_SOURCE}."
    )

    def draw(figure: Figure) -> None:
        """Draw speed (above) and flow (below) over density: a dot for each area and moment, beside people."""
        upper, lower = panels(figure, 2)
        density, least, most = np.array(ONE_WAY_SPEEDS).T
        upper.fill_between(density, least, most, color=BAND, label="people, one way")
        lower.fill_between(density, least * density, most * density, color=BAND)
        far = max(1.1 * float(table.density.max()), 3.5)
        at = np.linspace(0.05, far, 120)
        for panel, speed in ((upper, weidmann_speed(at)), (lower, weidmann_speed(at) * at)):
            panel.plot(at, speed, color=COLORS[6], linewidth=1.0, label=WEIDMANN_SOURCE)
        names = [str(area) for area in table.area.unique()]
        for number, area in enumerate(names):
            rows = table[table.area == area]
            look: dict[str, Any] = {"s": 7, "alpha": 0.5, "color": color(number), "linewidths": 0.0}
            upper.scatter(rows.density, rows.speed, label=area, **look)
            lower.scatter(rows.density, rows.speed * rows.density, **look)
        upper.set(xlabel="density [1/m²]", ylabel="speed [m/s]", xlim=(0.0, far), ylim=(0.0, None))
        lower.set(xlabel="density [1/m²]", ylabel="flow [1/(m s)]", xlim=(0.0, far), ylim=(0.0, None))
        legend(upper)

    return Result(name, title, values, (*sentences,), table, draw)


def _in_words(speed: float) -> str:
    """Return a speed [m/s] in words; nan is an unknown one."""
    return f"{speed:.2f} m/s" if np.isfinite(speed) else "no speed is known"


def _by_density(rows: pandas.DataFrame) -> list[dict[str, Any]]:
    """Return count and quantiles of the speed by density, in steps of 0.25 /m2, with the measured band of people.

    ``rows`` are those of one area. Densities below the first step count as the first step; rows without a known speed
    do not count. The band is None outside of the densities at which people were measured.
    """
    density, least, most = np.array(ONE_WAY_SPEEDS).T
    steps = np.maximum(np.round(rows["density"].to_numpy() / 0.25), 1.0) * 0.25
    found = []
    for at in np.unique(steps).tolist():
        speeds = rows["speed"].to_numpy()[steps == at]
        speeds = speeds[np.isfinite(speeds)]
        known = density[0] <= at <= density[-1]
        if len(speeds):
            quantiles = np.quantile(speeds, (0.05, 0.5, 0.95)).tolist()
            found.append(
                {
                    "density": at,
                    "moments": len(speeds),
                    **dict(zip(("speed_p5", "speed_median", "speed_p95"), quantiles, strict=True)),
                    "weidmann": float(weidmann_speed(at)),
                    "people_p5": float(np.interp(at, density, least)) if known else None,
                    "people_p95": float(np.interp(at, density, most)) if known else None,
                }
            )
    return found


def levels_of_service(measured: Measured, _: Tracks) -> Result:
    """Return the share of each level of service in the time that people spend in each area, by two tables of Fruin."""
    name, title = "service", "Level of service"
    table = measured.table
    if not len(table):
        return Result(name, title, {}, measured.sentences)
    values: dict[str, Any] = {}
    rows, sentences = [], []
    for service in (WALKWAYS, QUEUES):
        values[service.name] = {}
        for area, moments in table.groupby("area", sort=False):
            shares = level_shares(moments["density_classic"].to_numpy(float), service)
            values[service.name][str(area)] = shares
            rows.append({"table": service.name, "area": area, **shares})
            told = ", ".join(f"{level} {share:.0%}" for level, share in shares.items() if share >= 0.005)
            sentences.append(f"{area}, {service.name}: {told}.")
    sentences.append(
        "Shares are of the time that people spend in the area, by the area that each has (classic density)."
    )
    shares_table = pandas.DataFrame(rows)

    def draw(figure: Figure) -> None:
        """Draw for each service table a bar for each area, divided by the shares of the levels A to F."""
        look = ("#1a9850", "#91cf60", "#d9ef8b", "#fee08b", "#fc8d59", "#d73027")
        for axes, service in zip(panels(figure, 2, names_beside=True), (WALKWAYS, QUEUES), strict=True):
            mine = shares_table[shares_table.table == service.name]
            before = np.zeros(len(mine))
            for level, shade in zip(LEVELS, look, strict=True):
                axes.barh(mine.area, mine[level], left=before, color=shade, height=0.6, label=level)
                before = before + mine[level].to_numpy()
            axes.set(title=service.name, xlim=(0.0, 1.0), xlabel="share of the time of people in the area")
            axes.invert_yaxis()
            axes.legend(frameon=False, fontsize="small", loc="center left", bbox_to_anchor=(1.0, 0.5))

    return Result(name, title, values, (*sentences,), shares_table, draw)


def level_shares(density: NDArray[np.float64], service: ServiceTable) -> dict[str, float]:
    """Return the share of each level over densities (n,) above 0 [1/m2] of one area, weighted by the people in it.

    The number of people in the area is proportional to the density, so the density is the weight.
    """
    with np.errstate(divide="ignore"):
        space = 1.0 / density
    # Negated, the least areas ascend, as searchsorted needs; A, number 0, has at least the first of them.
    level = np.searchsorted(-np.array(service.least_areas), -space, side="left")
    weights = np.bincount(level, density, minlength=len(LEVELS))
    return dict(zip(LEVELS, (weights / weights.sum()).tolist(), strict=True))
