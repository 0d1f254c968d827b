"""Everyone's node is played on by one step."""

from __future__ import annotations

from crowdsim.crowd.state.assets import Assets
from crowdsim.crowd.systems.animate_kernels import advance
from crowdsim.ecs.world import View


def animate(assets: Assets, view: View) -> None:
    """Advance frames, seams and poses of all rows."""
    advance(
        assets.graph,
        assets.frames_per_step,
        view.node,
        view.previous,
        view.frame,
        view.origin,
        view.seam,
        view.next_node,
        view.next_origin,
        view.next_seam,
        view.next_cursor,
        view.cursor,
        view.behavior,
        view.pose,
    )
