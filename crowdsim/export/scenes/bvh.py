"""Write agents as BVH, one per file: Y up, centimeters, as the clips of the behavior library.

A file holds the frames in which the agent is present. Positions continue across the ends of a periodic floor.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from crowdsim.errors import CrowdSimError
from crowdsim.export.choice import Choice
from crowdsim.export.options import ExportOptions
from crowdsim.export.scenes.bodies import BodyMotion, body_motions, jumps
from crowdsim.export.tables.text_rows import decimals, text_rows
from crowdsim.motion.captures.bvh_writer import CENTIMETERS, hierarchy, joint_angles, to_y_up
from crowdsim.recording.reader import Recording
from crowdsim.whole_files import whole_file


def write(recording: Recording, file: Path, choice: Choice, options: ExportOptions) -> None:
    """Write a file of the chosen agent, which has to be the only one.

    Raises
    ------
    CrowdSimError
        If several agents are chosen, or the agent is never present, or is absent for a while in between.
    """
    motions = list(body_motions(recording, choice)) if len(choice.agents) == 1 else []
    if len(motions) != 1:
        chosen = f"agent {choice.agents[0]} never is" if len(choice.agents) == 1 else f"{len(choice.agents)} are chosen"
        raise CrowdSimError(
            f"a BVH file holds one character that is present at some time, but {chosen}; "
            "choose one with --agents, or write a folder with: -o FOLDER --format bvh"
        )
    file.write_bytes(_text(recording, motions[0], choice.rate))


def write_folder(recording: Recording, folder: Path, choice: Choice, options: ExportOptions) -> None:
    """Write a file for each chosen agent that is ever present; create the folder if necessary.

    Raise CrowdSimError if an agent is absent for a while in between. Files of agents before it are then kept.
    """
    folder.mkdir(exist_ok=True)
    digits = len(str(max(recording.agent_count - 1, 0)))
    for motion in body_motions(recording, choice):
        with whole_file(folder / f"character-{motion.agent:0{digits}d}.bvh", (".bvh",), "BVH files") as written:
            written.write_bytes(_text(recording, motion, choice.rate))


def _text(recording: Recording, motion: BodyMotion, rate: int) -> bytes:
    """Return the text of a file, with positions to a micrometer and angles to a thousandth of a degree."""
    if motion.frames[-1] - motion.frames[0] + 1 != len(motion.frames):
        raise CrowdSimError(
            f"character {motion.agent} is absent for a while, which BVH cannot express; use --start and --end"
        )
    roots = motion.roots.astype(np.float64)
    # Shift all positions after a crossing, so that the agent goes on beyond the end of a periodic floor.
    for leap in jumps(recording, motion.roots):
        roots[leap.row :] += leap.beyond.astype(np.float64) - motion.roots[leap.row]
    lines, order = hierarchy(recording.header.motion.skeleton)
    angles = joint_angles(motion.rotations[:, order].astype(np.float64)).reshape(len(roots), -1)
    lines += ["MOTION", f"Frames: {len(roots)}", f"Frame Time: {1.0 / rate:.8f}", ""]
    columns = [decimals(column, 4) for column in (to_y_up(roots) * CENTIMETERS).T]
    return "\n".join(lines).encode("ascii") + text_rows([*columns, *(decimals(column, 3) for column in angles.T)], " ")
