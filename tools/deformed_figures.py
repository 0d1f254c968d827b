"""Print the figures of bodies posed from deformed clips: ``python tools/deformed_figures.py [FOLDER]``.

One row per clip and kind of track, for the built-in sets and the captures in FOLDER. ``--tracks FILE`` adds the tracks
of a recorded crowd, an ``.npz`` with an (N, 4) array of x, y [m], heading [rad] and phase [cycles] at 10 Hz for each
body. The last column is microseconds per pose, with all bodies in one call.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from crowdsim.errors import MotionError
from crowdsim.motion.captures.reader import read_capture
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.deformed.deformed_clip import DeformedClip, deform_clip
from crowdsim.motion.deformed.joined_tracks import smooth_tracks
from crowdsim.motion.deformed.step_plan import plan_steps, pose_at
from crowdsim.motion.synthesis.library import synthesize_set
from crowdsim.motion.synthesis.styles import DANCING, HAPPY, PLAIN
from tests.support.deformed_figures import figures_of
from tests.unit.motion.deformed.tracks import TRACKS

CLIPS = {("frontal", "walk"), ("arm_constrained", "walk"), ("lateral", "side_left")}


def clips(folder: Path | None) -> Iterator[tuple[str, Clip]]:
    """Yield the clips to measure, with their names."""
    for name, manner in (("default", PLAIN), ("happy", HAPPY), ("dance", DANCING)):
        for behavior, _, clip in synthesize_set(manner):
            if (behavior, clip.name) in CLIPS:
                yield f"{name} {behavior}", clip
    for path in sorted(folder.glob("*.bvh")) if folder else ():
        for clip in read_capture(path).clips:
            yield clip.name, clip


def microseconds(clip: DeformedClip, tracks: list[np.ndarray]) -> float:
    """Return the processor time per pose [us], all poses at 30 per second in one call, the best of three."""
    plan = plan_steps(clip, tracks)
    seconds = [(len(track) - 1) * plan.step for track in tracks]
    times = [np.arange(0.0, end, 1.0 / 30.0) for end in seconds]
    bodies = np.repeat(np.arange(len(tracks)), [len(each) for each in times])
    out = pose_at(clip, plan, bodies, np.concatenate(times))
    taken = []
    for _ in range(3):
        begin = time.process_time()
        pose_at(clip, plan, bodies, np.concatenate(times), out)
        taken.append(time.process_time() - begin)
    return 1e6 * min(taken) / len(bodies)


def main() -> None:
    """Print all rows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("--tracks", type=Path)
    options = parser.parse_args()
    tracks = dict(TRACKS)
    if options.tracks:
        recorded = np.load(options.tracks)
        shown = smooth_tracks([recorded[name] for name in recorded.files])
        tracks |= {f"recorded {name}": track for name, track in zip(recorded.files, shown, strict=True)}
    print("clip | track | drift mm | knee deg | reach | acceleration m/s2 | feet apart cm | us a pose")
    for name, source in clips(options.folder):
        try:
            clip = deform_clip(source, 1.25)
        except MotionError as error:
            print(f"{name} | {error}")
            continue
        for kind, track in tracks.items():
            found = figures_of(clip, track)
            knee = f"{found.knee[0]:.0f}-{found.knee[1]:.0f}"
            print(
                f"{name} | {kind} | {1e3 * found.drift:.2f} | {knee} | {found.reach:.4f} | {found.acceleration:.1f}"
                f" | {100.0 * found.apart:.1f} | {microseconds(clip, [track]):.2f}",
                flush=True,
            )
        print(f"{name} | all | | | | | | {microseconds(clip, list(tracks.values()) * 20):.2f}", flush=True)


if __name__ == "__main__":
    main()
