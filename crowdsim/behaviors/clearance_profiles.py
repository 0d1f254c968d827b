"""Width of the body over height for each behavior, and heights that represent layers (2018 paper, 3.1, 3.2)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.behaviors.behavior import read_behavior
from crowdsim.behaviors.library import LEGS_TOP
from crowdsim.errors import BehaviorError
from crowdsim.motion.captures.reader import read_clip
from crowdsim.motion.clips.clearance import clearance_profile
from crowdsim.whole_files import whole_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]

PROFILE_FILE = "clearance.csv"
"""Name of the file that :func:`write_profile` writes beside a behavior's ``behavior.yaml``."""

HEIGHTS = np.round(np.arange(0.05, 1.95, 0.05), 2)
"""Heights above the floor at which bodies are measured [m]."""


class ClearanceProfile(NamedTuple):
    """Diameters that enclose the body across its motion, by height.

    Attributes
    ----------
    behavior, color : str
        Name and color of the behavior.
    heights : (H,) float64
        Heights above the floor [m].
    diameters : (H,) float64
        Largest diameter of any frame [m], 0 above the head.
    quartiles : (3, H) float64
        Quartiles of the diameters of all frames [m].
    """

    behavior: str
    color: str
    heights: Floats
    diameters: Floats
    quartiles: Floats


def measure_profile(name: str, library: Path, heights: Floats = HEIGHTS) -> ClearanceProfile:
    """Measure all clips of the behavior ``name`` in a library folder, over all sides that it faces.

    Raises
    ------
    BehaviorError, MotionError
        If its files cannot be used, or if it lists no clips, as a behavior of captures may.
    """
    behavior = read_behavior(name, library)
    if not behavior.clips:
        raise BehaviorError(f"behavior {name!r} lists no clips to be measured; name them under 'clips'")
    clips = [read_clip(library / name / entry.file) for entry in behavior.clips]
    frames = np.concatenate(
        [clearance_profile(clip, heights, float(np.radians(side))) for clip in clips for side in behavior.facing]
    )
    diameters = frames.max(axis=0, initial=0.0)
    quartiles = np.quantile(frames, [0.25, 0.5, 0.75], axis=0) if len(frames) else np.zeros((3, len(heights)))
    return ClearanceProfile(name, behavior.color, heights, diameters, quartiles)


def representative_heights(
    profiles: Sequence[ClearanceProfile], bands: Sequence[tuple[float, float]]
) -> tuple[float, ...]:
    """Return the height in each band (low, high) at which any behavior is widest, the lowest of equal ones [m].

    One horizontal plane at this height represents the band best. It is one of the measured heights, which all profiles
    share; the middle of a band in which none lies.
    """
    widest = np.max([profile.diameters for profile in profiles], axis=0)
    heights = profiles[0].heights
    chosen = []
    for low, high in bands:
        inside = (heights >= low) & (heights <= high)
        chosen.append(float(heights[inside][np.argmax(widest[inside])]) if inside.any() else 0.5 * (low + high))
    return tuple(chosen)


def write_profile(profile: ClearanceProfile, library: Path) -> Path:
    """Write heights, diameters and quartiles [m] beside the behavior's ``behavior.yaml``; return the path of the file.

    ``library`` is the folder that holds the folder of the behavior.
    """
    file = library / profile.behavior / PROFILE_FILE
    rows = np.column_stack([profile.heights, profile.diameters, profile.quartiles.T])
    with whole_file(file, (".csv",), "profiles") as written:
        np.savetxt(
            written, rows, fmt="%.4f", delimiter=",", header="height,largest,quarter,median,three_quarters", comments=""
        )
    return file


def draw_profiles(profiles: Sequence[ClearanceProfile], bands: Sequence[tuple[str, float, float]]) -> Figure:
    """Draw diameters over height for each behavior, with the layers' bands and planes (2018 paper, figure 2).

    ``bands`` are (name, low, high) [m], lowest first. A line marks the representative height of each band.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 6.0), dpi=110, layout="constrained")
    axes = figure.add_subplot()
    for profile in profiles:
        some = profile.diameters > 0.0
        heights = profile.heights[some]
        low, middle, high = profile.quartiles[:, some]
        name = profile.behavior.replace("_", " ")
        axes.plot(profile.diameters[some], heights, color=profile.color, linewidth=2.0, label=name)
        axes.plot(middle, heights, color=profile.color, linewidth=1.0, linestyle="--")
        axes.fill_betweenx(heights, low, high, color=profile.color, alpha=0.15, linewidth=0.0)
    # Only the legs count for the lowest layer; hanging hands belong to the next.
    planes = representative_heights(
        profiles, [(low, min(high, LEGS_TOP) if k == 0 else high) for k, (_, low, high) in enumerate(bands)]
    )
    # Room for the names of the layers on the right.
    right = 1.15 * max(float(profile.diameters.max()) for profile in profiles)
    for (name, low, high), plane in zip(bands, planes, strict=True):
        axes.axhspan(low, high, color="#808080", alpha=0.08, linewidth=0.0)
        axes.axhline(plane, color="#606060", linewidth=0.8)
        axes.annotate(
            f"{name}, {plane:.2f} m", (right, plane), ha="right", va="bottom", color="#404040", fontsize="small"
        )
    axes.set(xlim=(0.0, right), ylim=(0.0, None), xlabel="diameter across the motion [m]", ylabel="height [m]")
    axes.legend(loc="upper right", title="largest of all frames;\ndashed: median, with quartiles", frameon=False)
    return figure
