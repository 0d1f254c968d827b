"""Draw every picture of README and docs anew: ``python tools/draw_pictures.py [FILE ...]``, FILE as in PICTURES below.

The scenarios of the library are run for it, each once.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path

import shapely
from PIL import Image
from shapely import affinity

import crowdsim
from crowdsim.crowd.state.assets import load_behaviors
from crowdsim.figures import write_figure
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.playback.shot import shot
from crowdsim.recording.reader import Recording
from crowdsim.scenario.loader import builtin_scenarios, parse_scenario
from crowdsim.scenario.picture import draw_scenario
from crowdsim.scenario.scenario import Scenario

ROOT = Path(__file__).resolve().parents[1]
THUMBNAIL = (640, 400)
TIMES = {
    "apartment": 7.2,
    "bottleneck": 14.0,
    "clutter": 12.0,
    "corridor": 54.0,
    "counterflow": 30.0,
    "crossing": 12.0,
    "plaza": 22.0,
}
"""Seconds at which much is going on; the others are drawn at the moment that ``crowdsim play --shot`` chooses."""
RADIUS = 0.25

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
"""Ten thousand people, both ways and across."""

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
"""Two corridors that cross, walked in all four directions."""


class Recordings:
    """Recordings of scenarios in a folder that goes when all pictures are drawn."""

    def __init__(self, stack: ExitStack) -> None:
        self._stack = stack
        self._folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        self._done: dict[str, Recording] = {}

    def of(self, name: str) -> Recording:
        """The recording of a scenario of the library, which is run if it was not yet."""
        if name not in self._done:
            self._run(name, crowdsim.load_scenario(name))
        return self._done[name]

    def of_text(self, text: str) -> Recording:
        """The recording of a scenario given as text."""
        scenario = parse_scenario(text)
        self._run(scenario.name, scenario)
        return self._done[scenario.name]

    def _run(self, name: str, scenario: Scenario) -> None:
        simulation = self._stack.enter_context(crowdsim.Simulation(scenario))
        self._done[name] = self._stack.enter_context(simulation.run(self._folder / f"{name}.h5"))


def write_small(file: Path) -> None:
    """Write a picture of few hues again with 256 colors."""
    with Image.open(file) as drawn:
        small = drawn.convert("RGB").quantize(256)
    small.save(file, optimize=True)


def thumbnail(name: str) -> Callable[[Path, Recordings], None]:
    """What draws the thumbnail of a scenario."""

    def draw(file: Path, recordings: Recordings) -> None:
        shot(recordings.of(name), file, TIMES.get(name), size=THUMBNAIL)
        write_small(file)

    return draw


def corridor(file: Path, recordings: Recordings) -> None:
    shot(recordings.of("corridor"), file, TIMES["corridor"])


def corridor_lateral(file: Path, recordings: Recordings) -> None:
    """Somebody in the narrowest gap."""
    shot(recordings.of("corridor"), file, 54.2, "follow", agent=6)


def levels(file: Path, recordings: Recordings) -> None:
    """Who is captured, and who steers."""
    shot(recordings.of("plaza"), file, 20.0, color_by="level")
    write_small(file)


def apartment_layers(file: Path, recordings: Recordings) -> None:
    """As ``crowdsim check apartment --picture`` draws it."""
    scenario = crowdsim.load_scenario("apartment")
    write_figure(draw_scenario(scenario, load_behaviors(scenario).behaviors), file)
    write_small(file)


def counterflow(file: Path, recordings: Recordings) -> None:
    """Both ways through the corridor, in lanes."""
    shot(recordings.of("counterflow"), file, TIMES["counterflow"])
    write_small(file)


def street(file: Path, recordings: Recordings) -> None:
    """In the midst of ten thousand."""
    shot(recordings.of_text(STREET), file, 20.0, "follow", agent=4200)


def four_ways(file: Path, recordings: Recordings) -> None:
    shot(recordings.of_text(FOUR_WAYS), file, 14.0)
    write_small(file)


def navmesh(file: Path, recordings: Recordings) -> None:
    """A mesh of two furnished rooms with a path."""
    mesh = NavMesh(rooms())
    mesh.picture(mesh.find_path((0.6, 1.5), (7.3, 5.6), RADIUS), file=file)
    write_small(file)


def box(x: float, y: float, width: float, depth: float, turn: float = 0.0) -> shapely.Polygon:
    """A piece of furniture around (x, y), turned by ``turn`` degrees."""
    shape = shapely.box(x - 0.5 * width, y - 0.5 * depth, x + 0.5 * width, y + 0.5 * depth)
    return affinity.rotate(shape, turn)


def rooms() -> shapely.Polygon:
    """A living room with a table, and two smaller rooms behind doors of 1 m."""
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


PICTURES: Mapping[str, Callable[[Path, Recordings], None]] = {
    "docs/images/corridor.png": corridor,
    "docs/images/corridor_lateral.png": corridor_lateral,
    "docs/images/apartment_layers.png": apartment_layers,
    "docs/images/counterflow.png": counterflow,
    "docs/images/levels.png": levels,
    "docs/images/four_ways.png": four_ways,
    "docs/images/street.jpg": street,
    "docs/images/navmesh.png": navmesh,
    **{f"scenarios/assets/{name}.png": thumbnail(name) for name in builtin_scenarios()},
}
"""What draws each picture, by its file below the root."""


def main() -> None:
    with ExitStack() as stack:
        recordings = Recordings(stack)
        for name in sys.argv[1:] or PICTURES:
            file = ROOT / name
            PICTURES[name](file, recordings)
            print(f"{name}: {file.stat().st_size // 1000} kB")


if __name__ == "__main__":
    main()
