"""Draw scenarios/assets/NAME.png, a thumbnail of each scenario: ``python tools/draw_scenarios.py [NAME ...]``"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from PIL import Image

import crowdsim
from crowdsim.playback.shot import shot
from crowdsim.scenario.loader import builtin_scenarios

FOLDER = Path(__file__).resolve().parents[1] / "scenarios" / "assets"
SIZE = (640, 400)
TIMES = {"apartment": 7.2, "bottleneck": 14.0, "clutter": 12.0, "corridor": 54.0, "crossing": 12.0, "plaza": 22.0}
"""Seconds at which much is going on; the others are drawn at the moment that ``crowdsim play --shot`` chooses."""


def main() -> None:
    FOLDER.mkdir(exist_ok=True)
    for name in sys.argv[1:] or builtin_scenarios():
        picture = FOLDER / f"{name}.png"
        with (
            tempfile.TemporaryDirectory() as folder,
            crowdsim.Simulation(crowdsim.load_scenario(name)).run(Path(folder) / "run.h5") as recording,
        ):
            shot(recording, picture, TIMES.get(name), size=SIZE)
        Image.open(picture).convert("RGB").quantize(256).save(picture, optimize=True)
        print(f"{picture}: {picture.stat().st_size // 1000} kB")


if __name__ == "__main__":
    main()
