"""Import of 3D worlds: time to layers and meshes, agreement with laser maps, and free area.

The reached area is where the center of a disc can be on the given floor without meeting an obstacle of the legs layer;
the outline of the floor is no obstacle for it. Pieces below :data:`LEAST_PIECE` are ignored.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from crowdsim.bench.places.laser_map import LaserMap, read_laser_map
from crowdsim.bench.registry import Measurement
from crowdsim.environment.floor_plans import read_floor_plan
from crowdsim.environment.floors import SolidsOnFloor, place_on_floor
from crowdsim.environment.layers import LEGS, TORSO, Band, ClearanceLayer, clearance_layers, polygons_only
from crowdsim.environment.mesh_files import read_mesh_file
from crowdsim.errors import CrowdSimError
from crowdsim.navmesh.navmesh import NavMesh

PASSES = 5

LEAST_PIECE = 0.5
"""Least area of a piece that counts [m2]."""

NEAR = 0.20
"""Largest distance of an occupied cell from an obstacle's outline [m]."""

LASER = Band("laser", 0.20, 0.30)
"""Approximate height band in which the robot's laser scans."""

SHARE = 0.03
"""Relative tolerance of an area."""

REACHED: dict[str, dict[float, tuple[float, ...]]] = {
    "small_house": {0.15: (124.0,), 0.25: (109.0,), 0.30: (102.0,), 0.35: (95.0,)},
    "tb3_house": {0.30: (100.0,), 0.35: (47.0, 46.0)},
}
"""Required area of each piece, largest first [m2], by world and radius [m]."""

_SECONDS = {"small_house": 1.5}
"""Largest time from the file to both meshes [s], by world."""
_MEGABYTES = 500.0
"""Largest peak of memory [MB]."""

# The peak of getrusage would include that of the parent process before the fork, so /proc is read instead.
_CHILD = """
import sys
from pathlib import Path
from crowdsim.bench.places.environment import prepare
prepare(Path(sys.argv[1]), {})
status = Path("/proc/self/status").read_text().split()
print(int(status[status.index("VmHWM:") + 1]) / 1024.0)
"""


class Prepared(NamedTuple):
    """A world on its floor, with layers and meshes."""

    place: SolidsOnFloor
    layers: tuple[ClearanceLayer, ...]
    meshes: tuple[NavMesh, ...]


class _Table:
    """Collects rows."""

    def __init__(self) -> None:
        self.rows: list[dict[str, Any]] = []
        self.figures: dict[str, float] = {}

    def add(self, world: str, what: str, value: float, unit: str, bar: str = "", held: bool | None = None) -> None:
        """Add a row; ``bar`` is the requirement in words, ``held`` whether it is met."""
        verdict = None if held is None else "yes" if held else "NO"
        self.rows.append(
            {"world": world, "what": what, "value": round(value, 4), "unit": unit, "bar": bar, "held": verdict}
        )
        words = f"{world} {what} {unit}".replace("%", "percent").replace(",", "").replace(".", "_")
        self.figures["_".join(words.split())] = value


def measure(worlds: Path | None = None) -> Measurement:
    """Measure the worlds in the folder ``worlds``, by default ``../shared/worlds`` (or that of ``CROWDSIM_SHARED``)."""
    folder = worlds or Path(os.environ.get("CROWDSIM_SHARED", "../shared")) / "worlds"
    table = _Table()
    for name in REACHED:
        if not (folder / f"{name}.glb").is_file():
            raise CrowdSimError(f"{folder}: there is no {name}.glb; give the folder of worlds with --worlds FOLDER")
        prepared = measure_times(table, folder / f"{name}.glb")
        measure_layers(table, name, prepared)
        measure_reach(table, name, prepared)
        laser = folder / f"{name}_map" / "map.yaml"
        if laser.is_file():
            measure_fit(table, name, prepared, read_laser_map(laser))
    return Measurement(table.rows, table.figures)


def prepare(world: Path, seconds: dict[str, float]) -> Prepared:
    """Turn a world, with its floor in the file NAME_floor.wkt beside it, into layers and meshes.

    The time of each step is written to ``seconds`` by its name [s].
    """

    def timed(step: str, call: Callable[[], Any]) -> Any:
        """Return what ``call`` returns, and note its time as that of ``step``."""
        begin = time.perf_counter()
        result = call()
        seconds[step] = time.perf_counter() - begin
        return result

    floor = read_floor_plan(world.with_name(f"{world.stem}_floor.wkt")).floor
    scene = timed("read", lambda: read_mesh_file(world))
    place = timed("place on the floor", lambda: place_on_floor(scene.solids, floor))
    layers = timed("layers", lambda: clearance_layers(place.floor, place.solids, [LEGS, TORSO]))
    meshes = timed("meshes", lambda: tuple(NavMesh(layer.free) for layer in layers))
    return Prepared(place, layers, meshes)


def measure_times(table: _Table, world: Path) -> Prepared:
    """Measure the time from the file to both meshes [s], and the memory of a process that does nothing else."""
    prepared = prepare(world, {})  # not timed: compiles kernels
    samples: list[dict[str, float]] = [{} for _ in range(PASSES)]
    processor = []
    for sample in samples:
        begin = time.process_time()
        prepared = prepare(world, sample)
        processor.append(time.process_time() - begin)
    for step in samples[0]:
        table.add(world.stem, step, statistics.median(sample[step] for sample in samples), "s")
    total = statistics.median(sum(sample.values()) for sample in samples)
    bar = _SECONDS.get(world.stem)
    table.add(world.stem, "file to both meshes", total, "s", f"< {bar}" if bar else "", total < bar if bar else None)
    # Processor time depends less on other load of the machine.
    table.add(world.stem, "file to both meshes, processor time", statistics.median(processor), "s")
    if not Path("/proc/self/status").is_file():
        return prepared  # only Linux has /proc with the peak of a process
    child = subprocess.run([sys.executable, "-c", _CHILD, str(world)], capture_output=True, text=True)
    if child.returncode:
        last = (child.stderr.strip().splitlines() or ["no message"])[-1]
        raise CrowdSimError(f"the benchmark's child process failed: {last}")
    peak = float(json.loads(child.stdout))
    table.add(world.stem, "peak memory", peak, "MB", f"< {_MEGABYTES:g}", peak < _MEGABYTES)
    return prepared


def measure_layers(table: _Table, name: str, prepared: Prepared) -> None:
    """Measure sizes, and whether obstacles of the torso lie within those of the legs."""
    legs, torso = prepared.layers
    table.add(name, "solids", len(prepared.place.solids), "")
    table.add(name, "corners of the legs layer", int(shapely.get_num_coordinates(legs.free)), "")
    table.add(name, "legs obstacles", legs.obstacles.area, "m2")
    table.add(name, "torso obstacles", torso.obstacles.area, "m2")
    outside = torso.obstacles.difference(legs.obstacles).area
    table.add(name, "torso minus legs", outside, "m2", "0", outside <= 1e-6)


def measure_reach(table: _Table, name: str, prepared: Prepared) -> None:
    """Measure the pieces of the reached area by radius, and whether components of the mesh agree with them.

    Pieces beyond those required must not be.
    """
    floor, obstacles = prepared.place.floor, prepared.layers[0].obstacles
    for radius, expected in REACHED[name].items():
        pieces = pieces_reached(floor, obstacles, radius)
        for number, piece in enumerate(pieces):
            bar = expected[number] if number < len(expected) else 0.0
            close = abs(piece.area - bar) <= SHARE * bar
            what = f"reached at {radius:.2f} m, piece {number + 1}"
            table.add(name, what, piece.area, "m2", f"{bar:g} +-3 %" if bar else "none", close)
        table.add(name, f"pieces at {radius:.2f} m", len(pieces), "", str(len(expected)), len(pieces) == len(expected))
        # The floor is enlarged by the radius, as its outline is no obstacle.
        labels = _labels(NavMesh(polygons_only(floor.buffer(radius).difference(obstacles))), pieces, radius)
        # Each piece must lie in one component, no place of it off the mesh (-1), and no two pieces in the same.
        agree = all(len(own) == 1 and -1 not in own for own in labels) and len(set.union(*labels)) == len(pieces)
        table.add(
            name, f"components of the mesh at {radius:.2f} m", len(set.union(*labels)), "", str(len(pieces)), agree
        )


def pieces_reached(floor: BaseGeometry, obstacles: BaseGeometry, radius: float) -> list[BaseGeometry]:
    """Return the pieces of the floor at least ``radius`` [m] from obstacles, largest first, without tiny ones."""
    reached = polygons_only(floor.difference(obstacles.buffer(radius)))
    pieces = [piece for piece in reached.geoms if piece.area >= LEAST_PIECE]
    return sorted(pieces, key=lambda piece: -piece.area)


def _labels(mesh: NavMesh, pieces: list[BaseGeometry], radius: float) -> list[set[int]]:
    """Return, for each piece, the components of the mesh for a disc of ``radius`` [m] at places 0.1 m apart in it."""
    labels = []
    for piece in pieces:
        # Shrink a little, because the buffer replaces arcs by polygons.
        inner = piece.buffer(-0.02 * radius)
        x0, y0, x1, y1 = inner.bounds
        x, y = (grid.ravel() for grid in np.meshgrid(np.arange(x0, x1, 0.1), np.arange(y0, y1, 0.1)))
        inside = shapely.contains_xy(inner, x, y)
        labels.append({int(label) for label in mesh.components(np.column_stack([x, y])[inside], radius)})
    return labels


def measure_fit(table: _Table, name: str, prepared: Prepared, laser: LaserMap) -> None:
    """Compare layers with a robot's laser map of the same place.

    The requirement is on the band :data:`LASER` that a laser sees: at least 98 % of occupied cells near an outline, at
    most 0.5 % of the free ones that a robot can see inside obstacles. The legs layer rightly differs from it: it
    contains tops of tables and lamps that the laser passes below, whose legs stand far inside their outlines.
    """
    (seen,) = clearance_layers(prepared.place.floor, prepared.place.solids, [LASER])
    for layer, gate in ((seen, True), (prepared.layers[0], False)):
        shapely.prepare(layer.obstacles)
        outline = layer.obstacles.boundary
        shapely.prepare(outline)
        near = 100.0 * float(shapely.dwithin(shapely.points(laser.occupied), outline, NEAR).mean())
        what = f"{layer.name} layer, occupied cells within {NEAR} m of an outline"
        table.add(name, what, near, "%", ">= 98" if gate else "", near >= 98.0 if gate else None)
        for cells, which in ((laser.seen, "free cells a robot can see"), (laser.free, "all free cells")):
            inside = 100.0 * float(shapely.contains_xy(layer.obstacles, cells).mean())
            held = inside <= 0.5 if gate and cells is laser.seen else None
            bar = "<= 0.5" if held is not None else ""
            table.add(name, f"{layer.name} layer, {which} inside obstacles", inside, "%", bar, held)
