"""Write the clips of the default motion set again: ``python tools/build_default_motion.py [FOLDER]``.

The clips are synthesized and identical to the last bit each time, so a change in them comes from a change in
``crowdsim/motion/synthesis/*.py`` or ``crowdsim/motion/clips/arm_edit.py``. FOLDER is ``behaviors`` by default.
"""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from crowdsim.behaviors.behavior import list_behaviors  # noqa: E402
from crowdsim.behaviors.clearance_profiles import measure_profile, write_profile  # noqa: E402
from crowdsim.motion.captures.bvh_writer import write_bvh  # noqa: E402
from crowdsim.motion.synthesis.library import synthesize_set  # noqa: E402


def build(folder: Path) -> int:
    """Write every clip below ``folder``; remove clips that the set no longer has; return the number of bytes."""
    wanted: dict[Path, set[str]] = {}
    size = 0
    for behavior, file_name, clip in synthesize_set():
        clips = folder / behavior / "clips"
        clips.mkdir(parents=True, exist_ok=True)
        write_bvh(clip, clips / file_name)
        wanted.setdefault(clips, set()).add(file_name)
        size += (clips / file_name).stat().st_size
    for clips, names in wanted.items():
        for stale in sorted(set(clips.glob("*.bvh")) - {clips / name for name in names}):
            stale.unlink()
    for behavior in list_behaviors(folder):
        write_profile(measure_profile(behavior, folder), folder)
    return size


if __name__ == "__main__":
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "behaviors"
    print(f"{build(target) / 1e6:.2f} MB of clips in {target}")
