"""Summary of a folder of captures, file by file: what was assumed, removed and found, and how far feet drift."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from crowdsim.constants import CAPTURE_RATE
from crowdsim.errors import MotionError
from crowdsim.motion.captures.reader import Capture, read_capture
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.tracks import track_of
from crowdsim.motion.graph.features import CrossingDetector, StandingDetector
from crowdsim.motion.graph.segmentation import require_locomotion
from crowdsim.motion.graph.transition_drift import clip_stances


def summarize(
    path: Path, meters_per_unit: float | None = None, joints: Mapping[str, str] | None = None
) -> dict[str, Any]:
    """Return one row of a table: values by column, units in the names, None if there is none.

    ``meters_per_unit`` and ``joints`` are those of :func:`read_capture`. The column ``problem`` says why the file or
    its motion cannot be read, or that a clip is no locomotion (the last one, if there are several). A file that cannot
    be read has a row with nothing but its name and its problem.
    """
    row: dict[str, Any] = dict.fromkeys(_COLUMNS)
    row["file"] = path.name
    try:
        capture = read_capture(path, meters_per_unit, joints)
    except MotionError as error:
        row["problem"] = str(error).removeprefix(f"{path}: ")
        return row
    row |= _assumed(capture)
    try:
        row |= _found(capture.clips)
    except MotionError as error:
        row["problem"] = str(error)
    return row


def summarize_all(
    paths: Iterable[Path], meters_per_unit: float | None = None, joints: Mapping[str, str] | None = None
) -> list[dict[str, Any]]:
    """Return a row of :func:`summarize` for each of ``paths``."""
    return [summarize(path, meters_per_unit, joints) for path in paths]


_COLUMNS = tuple(
    (
        "file stretches frames rate_hz unit leg_m up facing tpose glitches assumed "
        "length_m speed_m_s turn_deg crossings rests drift_cm problem"
    ).split()
)


def _assumed(capture: Capture) -> dict[str, Any]:
    """Return the columns of the reader's report."""
    report = capture.report
    cuts = sorted({frame for frame, _ in report.glitches})
    return {
        "stretches": len(capture.clips),
        "frames": sum(clip.frame_count for clip in capture.clips),
        "rate_hz": round(report.source_rate, 3),
        "unit": report.unit,
        "leg_m": round(report.leg_length, 3),
        "up": report.up,
        "facing": report.facing,
        "tpose": "cut" if report.dropped_first else None,
        "glitches": " ".join(map(str, cuts)) or None,
        "assumed": "; ".join(report.assumed) or None,
    }


def _found(clips: Iterable[Clip]) -> dict[str, Any]:
    """Return figures of the motion over all stretches; raise MotionError if joints for them are missing."""
    length, turn, frames, crossings, rests = 0.0, 0.0, 0, 0, 0
    drifts: list[float] = []
    problem: str | None = None
    for clip in clips:
        track = track_of(clip)
        try:
            require_locomotion(clip, track)
        except MotionError as error:
            problem = str(error)
        length += float(np.linalg.norm(np.diff(track[:, :2], axis=0), axis=1).sum())
        turn += float(track[-1, 2] - track[0, 2])
        frames += max(clip.frame_count - 1, 1)
        crossings += len(CrossingDetector().cuts(clip))
        rests += len(StandingDetector().cuts(clip))
        drifts += [stance.drift for stance in clip_stances(clip)]
    return {
        "length_m": round(length, 2),
        "speed_m_s": round(length / frames * CAPTURE_RATE, 2),
        "turn_deg": round(float(np.degrees(turn)), 1),
        "crossings": crossings,
        "rests": rests,
        "drift_cm": round(100.0 * max(drifts), 2) if drifts else None,
        "problem": problem,
    }
