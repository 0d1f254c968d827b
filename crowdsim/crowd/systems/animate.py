"""The system that plays everyone's node on by one step."""

from __future__ import annotations

from dataclasses import dataclass

from crowdsim.crowd.state.assets import Setting
from crowdsim.crowd.systems.animate_kernels import advance
from crowdsim.ecs.world import View


@dataclass
class Advancing:
    """Frames, seams, poses: one kernel over all rows."""

    setting: Setting

    WRITES = (
        "node", "previous", "frame", "origin", "seam", "next_node", "next_origin", "next_seam", "next_cursor",
        "cursor", "behavior", "pose",
    )  # fmt: skip

    def run(self, view: View) -> None:
        advance(
            self.setting.graph, self.setting.frames_per_step, view.node, view.previous, view.frame, view.origin,
            view.seam, view.next_node, view.next_origin, view.next_seam, view.next_cursor,
            view.cursor, view.behavior, view.pose,
        )  # fmt: skip
