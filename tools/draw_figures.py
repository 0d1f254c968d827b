"""Draw the figures of docs anew: ``python tools/draw_figures.py [NAME ...]``, NAME as in FIGURES below.

Each is drawn from what the code computes, into ``docs/figures/NAME.svg``. With ``--check`` nothing is written: what is
drawn is compared with what the files say they show, and the exit code is 1 if one differs.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

from matplotlib.figure import Figure

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tools.figures import bodies, crowds, following, house, meshes, places, planning, steering
from tools.figures.style import alike, drawn, read_drawn, styled, write_svg

FOLDER = Path(__file__).resolve().parents[1] / "docs" / "figures"

FIGURES: Mapping[str, Callable[[], Figure]] = {
    "house": house.draw_house,
    "layers": places.draw_layers,
    "triangulation": meshes.draw_triangulation,
    "funnel": meshes.draw_funnel,
    "clearance-by-height": bodies.draw_clearance,
    "roadmap": planning.draw_roadmap,
    "gates": planning.draw_gate,
    "labels": planning.draw_labels,
    "motion-graph": bodies.draw_graph,
    "motion-map": following.draw_map,
    "branches": following.draw_branches,
    "timelines": crowds.draw_timelines,
    "guidance": steering.draw_guidance,
    "steering-view": steering.draw_view,
    "separating-lines": steering.draw_lines,
    "footprints": bodies.draw_footprints,
}
"""What draws each figure, by its name."""


def main() -> int:
    """Draw or compare the figures that the command line names; return the exit code."""
    parser = argparse.ArgumentParser(description="Draw the figures of docs.")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(FIGURES)}; without names, all")
    parser.add_argument("--check", action="store_true", help="compare with the files instead of writing them")
    given = parser.parse_args()
    unknown = [name for name in given.names if name not in FIGURES]
    if unknown:
        parser.error(f"there is no figure {', '.join(unknown)}; there are: {', '.join(FIGURES)}")
    differing = []
    with styled():
        for name in given.names or FIGURES:
            file = FOLDER / f"{name}.svg"
            figure = FIGURES[name]()
            if given.check:
                same = file.exists() and alike(read_drawn(file), drawn(figure))
                print(f"{name}: {'as the code draws it' if same else 'DIFFERS, draw it anew'}")
                differing += [] if same else [name]
                continue
            write_svg(figure, file)
            print(f"{name}: {file.stat().st_size / 1000:.0f} kB")
    return 1 if differing else 0


if __name__ == "__main__":
    sys.exit(main())
