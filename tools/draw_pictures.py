"""Draw the pictures of README and docs again: ``python tools/draw_pictures.py [FILE ...]``, FILE as in PICTURES below.

Each scenario of the library that they show is run once.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path

import av
import numpy as np
import shapely
from matplotlib.figure import Figure
from PIL import Image
from shapely import affinity

import crowdsim
from crowdsim.analysis.analyze import analyze
from crowdsim.analysis.measured_people import FLOW_BANDS
from crowdsim.analysis.report import write_analysis
from crowdsim.crowd.state.assets import load_behaviors
from crowdsim.figures import write_figure
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.playback.film import film
from crowdsim.playback.shot import shot
from crowdsim.recording.reader import Recording
from crowdsim.scenario.loader import builtin_scenarios, parse_scenario
from crowdsim.scenario.picture import draw_scenario
from crowdsim.scenario.scenario import Scenario
from crowdsim.sweeps.points import points_of
from crowdsim.sweeps.sweep import sweep
from crowdsim.sweeps.table import means_of

ROOT = Path(__file__).resolve().parents[1]
THUMBNAIL = (640, 400)
TIMES = {
    "apartment": 7.2,
    "bottleneck": 14.0,
    "clutter": 12.0,
    "corridor": 43.0,
    "counterflow": 30.0,
    "crossing": 12.0,
    "plaza": 22.0,
}
"""Busy times of scenarios [s]; the others are drawn at the time that ``crowdsim play --shot`` chooses."""
BY_GROUP = ("counterflow", "crossing")
"""Scenarios whose flows are told apart by colors of groups; in the others, colors show behaviors."""
RADIUS = 0.25
"""Clearance of the path in the picture of a mesh [m]."""

NECK = ROOT / "tools" / "studies" / "neck.yaml"
NECK_WIDTH = "obstacles.0.wall.openings.0.width"

WALKING_TIMES, WALKING_RATE, WALKING_SIZE = (46.5, 54.3), 15, (800, 450)
"""Start and end [s], pictures per second, and pixels of the moving picture."""

STREET = """\
crowdsim: 1
name: street
seed: 4
duration: 30
floor: {rectangle: [0, 0, 250, 50]}
obstacles:
  - {name: kiosk, box: {center: [60, 25], size: [4, 3]}, top: 2.7}
  - {name: stage, box: {center: [150, 25], size: [14, 8]}, top: 1.0}
agents:
  - {locomotion: steered, name: up, count: 4000, start: {rectangle: [1, 1, 249, 24]},
     goal: {rectangle: [246, 1, 249.5, 49]}}
  - {locomotion: steered, name: down, count: 4000, start: {rectangle: [1, 26, 249, 49]},
     goal: {rectangle: [0.5, 1, 4, 49]}}
  - {locomotion: steered, name: across, count: 1000, start: {rectangle: [1, 1, 249, 24]},
     goal: {rectangle: [1, 47, 249, 49.5]}}
  - {locomotion: steered, name: back, count: 1000, start: {rectangle: [1, 26, 249, 49]},
     goal: {rectangle: [1, 0.5, 249, 3]}}
"""
"""Ten thousand people who walk both ways and across."""

FOUR_WAYS = """\
crowdsim: 1
name: four ways
seed: 5
duration: 60
floor: {polygon: [[-14, -2], [-2, -2], [-2, -14], [2, -14], [2, -2], [14, -2], [14, 2], [2, 2], [2, 14], [-2, 14],
  [-2, 2], [-14, 2]]}
agents:
  - {locomotion: steered, name: east, count: 40, start: {rectangle: [-13, -1.6, -4, 1.6]},
     goal: {rectangle: [12, -1.7, 13.7, 1.7]}}
  - {locomotion: steered, name: west, count: 40, start: {rectangle: [4, -1.6, 13, 1.6]},
     goal: {rectangle: [-13.7, -1.7, -12, 1.7]}}
  - {locomotion: steered, name: north, count: 40, start: {rectangle: [-1.6, -13, 1.6, -4]},
     goal: {rectangle: [-1.7, 12, 1.7, 13.7]}}
  - {locomotion: steered, name: south, count: 40, start: {rectangle: [-1.6, 4, 1.6, 13]},
     goal: {rectangle: [-1.7, -13.7, 1.7, -12]}}
"""
"""Two crossing corridors, walked in all four directions."""

MUSEUM = """\
crowdsim: 1
name: museum
seed: 3
duration: 90
floor: {rectangle: [0, 0, 24, 16]}
obstacles:
  - {name: west, wall: {points: [[8, 0], [8, 16]], openings: [{at: 4, width: 1.8}, {at: 12, width: 1.8}]}, top: 3}
  - {name: east, wall: {points: [[16, 0], [16, 16]], openings: [{at: 4, width: 1.8}, {at: 12, width: 1.8}]}, top: 3}
  - {name: first case, box: {min: [3.5, 7.5], max: [4.5, 8.5]}, top: 1.2}
  - {name: second case, box: {min: [11.5, 7.5], max: [12.5, 8.5]}, top: 1.2}
  - {name: third case, box: {min: [19.5, 7.5], max: [20.5, 8.5]}, top: 1.2}
agents:
  - {name: visitors, count: 40, interval: 2, wait: 15, start: {rectangle: [0.5, 1, 2, 4]},
     goals: [{point: [4, 6.8]}, {point: [12, 9.2]}, {point: [20, 6.8]}, {rectangle: [22, 12, 23.5, 15]}]}
"""
"""Visitors who stand for a while at each of three exhibits."""


class Recordings:
    """Recordings of scenarios in a temporary folder."""

    def __init__(self, stack: ExitStack) -> None:
        self._stack = stack
        self._folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        self._done: dict[str, Recording] = {}

    def of(self, name: str) -> Recording:
        """Return the recording of a library scenario; run it at the first request."""
        if name not in self._done:
            self._run(name, crowdsim.load_scenario(name))
        return self._done[name]

    def of_text(self, text: str) -> Recording:
        """Return the recording of a scenario given as text."""
        scenario = parse_scenario(text)
        self._run(scenario.name, scenario)
        return self._done[scenario.name]

    def _run(self, name: str, scenario: Scenario) -> None:
        simulation = self._stack.enter_context(crowdsim.Simulation(scenario))
        self._done[name] = self._stack.enter_context(simulation.run(self._folder / f"{name}.h5"))


def write_small(file: Path) -> None:
    """Write a picture again with a palette of 256 colors."""
    with Image.open(file) as drawn:
        small = drawn.convert("RGB").quantize(256)
    small.save(file, optimize=True)


def thumbnail(name: str) -> Callable[[Path, Recordings], None]:
    """Return a function that draws the thumbnail of a scenario."""

    def draw(file: Path, recordings: Recordings) -> None:
        color_by = "group" if name in BY_GROUP else "behavior"
        shot(recordings.of(name), file, TIMES.get(name), size=THUMBNAIL, color_by=color_by)
        write_small(file)

    return draw


def corridor_lateral(file: Path, recordings: Recordings) -> None:
    """Draw an agent in the narrowest gap."""
    shot(recordings.of("corridor"), file, 50.0, "follow", agent=8)


def walking(file: Path, recordings: Recordings) -> None:
    """Draw a moving picture: sideways through the narrowest gap, then on."""
    with tempfile.TemporaryDirectory() as folder:
        shown = film(
            recordings.of("corridor"),
            Path(folder) / "walking.mp4",
            fps=WALKING_RATE,
            size=WALKING_SIZE,
            start=WALKING_TIMES[0],
            end=WALKING_TIMES[1],
            view="follow",
            agent=8,
        )
        with av.open(str(shown)) as container:
            first, *others = [frame.to_image() for frame in container.decode(video=0)]
    first.save(file, save_all=True, append_images=others, duration=1000 // WALKING_RATE, loop=0, quality=60, method=6)


def levels(file: Path, recordings: Recordings) -> None:
    """Draw captured and steered agents in their colors."""
    shot(recordings.of("plaza"), file, 20.0, color_by="level")
    write_small(file)


def apartment_layers(file: Path, recordings: Recordings) -> None:
    """Draw what ``crowdsim check apartment --picture`` draws."""
    scenario = crowdsim.load_scenario("apartment")
    write_figure(draw_scenario(scenario, load_behaviors(scenario).behaviors), file)
    write_small(file)


def counterflow(file: Path, recordings: Recordings) -> None:
    """Draw lanes in a corridor walked both ways."""
    shot(recordings.of("counterflow"), file, TIMES["counterflow"], color_by="group")
    write_small(file)


def street(file: Path, recordings: Recordings) -> None:
    """Draw a view from the middle of ten thousand people."""
    shot(recordings.of_text(STREET), file, 20.0, "follow", agent=4200, color_by="group")


def four_ways(file: Path, recordings: Recordings) -> None:
    """Draw the crossing of four flows."""
    shot(recordings.of_text(FOUR_WAYS), file, 14.0, color_by="group")
    write_small(file)


def museum(file: Path, recordings: Recordings) -> None:
    """Draw visitors who have gathered around exhibits."""
    shot(recordings.of_text(MUSEUM), file, 70.0)
    write_small(file)


def navmesh(file: Path, recordings: Recordings) -> None:
    """Draw a mesh of furnished rooms with a path."""
    mesh = NavMesh(rooms())
    mesh.picture(mesh.find_path((0.6, 1.5), (7.3, 5.6), RADIUS), file=file)
    write_small(file)


def box(x: float, y: float, width: float, depth: float, turn: float = 0.0) -> shapely.Polygon:
    """Return a piece of furniture around (x, y) [m], rotated by ``turn`` degrees."""
    shape = shapely.box(x - 0.5 * width, y - 0.5 * depth, x + 0.5 * width, y + 0.5 * depth)
    return affinity.rotate(shape, turn)


def rooms() -> shapely.Polygon:
    """Return a living room with a table, and two smaller rooms behind doors of 1 m."""
    walls = [
        shapely.box(5.9, 0.0, 6.05, 2.3),
        shapely.box(5.9, 3.3, 6.05, 7.0),
        shapely.box(6.05, 4.4, 7.3, 4.55),
        shapely.box(8.3, 4.4, 10.0, 4.55),
    ]
    seats = [(2.2, 2.15, 15), (3.2, 2.25, 5), (2.4, 4.1, 18), (3.5, 4.2, 0), (1.5, 2.9, 40), (4.4, 3.1, -20)]
    things = [box(x, y, 0.45, 0.45, turn) for x, y, turn in [*seats, (8.6, 5.7, 30)]]
    things += [
        box(2.9, 3.1, 1.8, 1.0, 12),
        box(1.3, 0.42, 2.0, 0.86),
        box(0.45, 6.1, 0.9, 1.8),
        box(2.35, 6.75, 2.1, 0.5),
    ]
    things += [box(9.15, 1.45, 1.7, 1.9), box(9.75, 2.78, 0.5, 0.45), box(6.7, 0.27, 1.35, 0.56)]
    things += [box(7.1, 6.65, 2.15, 0.7), box(9.68, 5.8, 0.65, 1.6)]
    things += [shapely.Point(4.9, 6.3).buffer(0.35, quad_segs=4), shapely.Point(5.2, 0.6).buffer(0.3, quad_segs=4)]
    return shapely.box(0.0, 0.0, 10.0, 7.0).difference(shapely.union_all(walls + things))


def analysis_flow(file: Path, recordings: Recordings) -> None:
    """Draw passages and flow at the neck, as ``crowdsim analyze`` does."""
    draw_analysis("flow", file, recordings)


def analysis_diagram(file: Path, recordings: Recordings) -> None:
    """Draw the fundamental diagram before the neck, as ``crowdsim analyze`` does."""
    draw_analysis("diagram", file, recordings)


def analysis_maps(file: Path, recordings: Recordings) -> None:
    """Draw the maps of the room with the neck, as ``crowdsim analyze`` does."""
    draw_analysis("maps", file, recordings)


def draw_analysis(name: str, file: Path, recordings: Recordings) -> None:
    """Draw one picture of an analysis of the study's scenario."""
    recording = recordings.of_text(NECK.read_text(encoding="utf-8"))
    with tempfile.TemporaryDirectory() as folder:
        write_analysis(analyze(recording, only=[name]), Path(folder))
        file.write_bytes((Path(folder) / f"{name}.png").read_bytes())
    write_small(file)


def neck_study(file: Path, recordings: Recordings) -> None:
    """Sweep the width of the neck over twenty seeds, and draw flow over width beside what was measured on people."""
    with tempfile.TemporaryDirectory() as folder:
        points = points_of(str(NECK), "1-20", [f"{NECK_WIDTH}=0.8,1.0,1.2,1.6,2.0"])
        rows = sweep(points, Path(folder), jobs=2).rows
    figure = Figure(figsize=(7.2, 3.8), dpi=110, layout="constrained")
    axes = figure.subplots()
    for number, band in enumerate(each for each in FLOW_BANDS if each.widest <= 2.3):
        width = np.array([band.narrowest, band.widest])
        label = None if number else "people in 73 bottlenecks, least to most"
        axes.fill_between(width, band.least * width, band.most * width, color="#c9d8e4", linewidth=0.0, label=label)
        axes.plot(
            width, band.median * width, color="#4c6b82", linewidth=1.0, label=None if number else "people, median"
        )
    means = means_of(rows, "lines.neck.flow")
    at = [float(mean.settings[0][1]) for mean in means]
    flow = [mean.mean for mean in means]
    off = [[mean.mean - mean.low for mean in means], [mean.high - mean.mean for mean in means]]
    for point, outcome in rows:
        axes.plot(float(point.settings[0][1]), outcome.figures["lines.neck.flow"], ".", color="#d55e00", markersize=3.0)
    axes.errorbar(
        at, flow, off, fmt="o-", color="#d55e00", capsize=3.0, label="crowdsim, mean of twenty seeds, 95 % band"
    )
    axes.set(xlabel="width of the neck [m]", ylabel="flow [1/s]", xlim=(0.4, 2.3), ylim=(0.0, None))
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False, fontsize="small", loc="upper left")
    write_figure(figure, file)
    write_small(file)


PICTURES: Mapping[str, Callable[[Path, Recordings], None]] = {
    "docs/images/walking.webp": walking,
    "docs/images/corridor_lateral.png": corridor_lateral,
    "docs/images/apartment_layers.png": apartment_layers,
    "docs/images/counterflow.png": counterflow,
    "docs/images/levels.png": levels,
    "docs/images/four_ways.png": four_ways,
    "docs/images/museum.png": museum,
    "docs/images/street.jpg": street,
    "docs/images/navmesh.png": navmesh,
    "docs/images/analysis_flow.png": analysis_flow,
    "docs/images/analysis_diagram.png": analysis_diagram,
    "docs/images/analysis_maps.png": analysis_maps,
    "docs/images/neck_study.png": neck_study,
    **{f"scenarios/assets/{name}.png": thumbnail(name) for name in builtin_scenarios()},
}
"""Functions that draw the pictures, by file below the root."""


def main() -> None:
    """Draw all pictures, or those named on the command line."""
    with ExitStack() as stack:
        recordings = Recordings(stack)
        for name in sys.argv[1:] or PICTURES:
            file = ROOT / name
            PICTURES[name](file, recordings)
            print(f"{name}: {file.stat().st_size // 1000} kB")


if __name__ == "__main__":
    main()
