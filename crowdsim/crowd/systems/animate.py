"""Playback: advance the nodes of all captured agents by one step."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.crowd.state.assets import Assets
from crowdsim.crowd.state.timelines import Playback
from crowdsim.crowd.systems.animate_kernels import advance
from crowdsim.ecs.world import View


class Playing(NamedTuple):
    """Columns that playback reads and changes; see :mod:`crowdsim.crowd.state.components`."""

    node: NDArray[np.int32]
    previous: NDArray[np.int32]
    frame: NDArray[np.int32]
    part: NDArray[np.int32]
    rate: NDArray[np.int32]
    wanted_rate: NDArray[np.int32]
    origin: NDArray[np.float64]
    blend_offset: NDArray[np.float64]
    next_node: NDArray[np.int32]
    next_origin: NDArray[np.float64]
    next_blend_offset: NDArray[np.float64]
    next_cursor: NDArray[np.int32]
    cursor: NDArray[np.int32]
    behavior: NDArray[np.int32]
    pose: NDArray[np.float64]


def animate(assets: Assets, view: View) -> None:
    """Play all rows on by one step: rates, frames, poses, and the next node if the present one ends.

    The columns of ``view`` are changed in place.
    """
    ramp = Playback.natural(0, assets.frames_per_step).ramp  # the same in every step
    advance(assets.graph, ramp, Playing(*(getattr(view, name) for name in Playing._fields)))
