"""Build plans from starts, cycles, stops and steps in place.

Numbers in the steps are choices that shape the built-in clips: distances [m], shares of a turn, and shares of the
frames that a gait swings a foot or stands on both.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crowdsim.errors import MotionError
from crowdsim.geometry.planar import compose
from crowdsim.motion.synthesis.footstep_plan import LEFT, RIGHT, STANDING_HALF_WIDTH, Hub, Plan, Step, along_arc
from crowdsim.motion.synthesis.styles import PLAIN, WALKING, Gait, Manner, Style

Floats = NDArray[np.float64]

REST = 10
"""Frames of standing still at the beginning and end of a clip."""
PASSING = 0.52
"""Share of the right foot's swing after which it passes the left one: where cycles are cut."""


class PlanBuilder:
    """Builder of a plan: each motion added begins where the last one ended.

    plan: the plan so far. body: (3,) body pose that the last step was put down for. frame: of the last landing, or up
    to which the body stands. gait: of the passing pose in which the plan ends so far, None if the body stands.
    """

    def __init__(self, name: str, style: Style = WALKING, manner: Manner = PLAIN) -> None:
        self.plan = Plan(name, style, manner)
        self.body = self.plan.start
        self.frame = float(REST)
        self.gait: Gait | None = None
        self.plan.hubs.append(Hub(0, "stand", self.body))
        self.plan.hubs.append(Hub(REST, "stand", self.body))

    def step(self, side: int, body: Floats, lift: float, land: float, half_width: float = STANDING_HALF_WIDTH) -> None:
        """Put one foot down for the body pose ``body``: x, y [m], heading [rad].

        ``side`` is LEFT or RIGHT, ``lift`` and ``land`` are frames of the plan, and ``half_width`` is the distance from
        the body pose to the ankle, sideways [m].
        """
        self.plan.steps.append(Step(side, lift, land, body, half_width))
        self.body = body
        self.frame = land

    def _pass(self, gait: Gait, left_landing: float) -> None:
        """Add the hub of ``gait`` in the right foot's swing after the left foot's landing at frame ``left_landing``."""
        self.plan.hubs.append(
            Hub(round(left_landing + gait.double_support + PASSING * gait.swing), gait.name, self.body)
        )
        self.gait = gait

    def _walking(self) -> Gait:
        """Return the present gait; raise MotionError if the body stands."""
        if self.gait is None:
            raise MotionError(f"plan '{self.plan.name}' stands here; a cycle or a stop must follow a start")
        return self.gait

    def _right_swing(self) -> tuple[float, float]:
        """Return the frames of lift-off and landing of the right foot, which passes the left one at the last hub."""
        gait = self._walking()
        lift = self.plan.hubs[-1].frame - PASSING * gait.swing
        return lift, lift + gait.swing

    def start(self, gait: Gait, length: float = 0.56) -> PlanBuilder:
        """Walk from standing, left foot first by ``length`` [m], to the passing pose of ``gait``."""
        return self._start_to(gait, along_arc(self.body, length, 0.0), self.frame + self.plan.style.soft)

    def start_right(self, gait: Gait) -> PlanBuilder:
        """Walk from standing, right foot first, to the passing pose of ``gait``: three steps of growing length."""
        lift = self.frame + self.plan.style.soft
        width = 0.5 * (gait.half_width + STANDING_HALF_WIDTH)
        self.step(RIGHT, along_arc(self.body, 0.42, 0.0), lift, lift + gait.swing * 0.95, width)
        return self._start_to(gait, along_arc(self.body, gait.stride * 0.48, 0.0), self.frame + gait.double_support)

    def cycle(self, gait: Gait, turn: float = 0.0, outer: float = 0.5, length: float | None = None) -> PlanBuilder:
        """Add one cycle from a passing pose to the passing pose of ``gait``, turning by ``turn`` [rad].

        outer: share of the turn that the right foot's landing takes; length: along the path [m], by default half a
        stride of the gait before and half a stride of ``gait``.
        """
        before = self._walking()
        start = self.plan.hubs[-1].frame
        lift, land = self._right_swing()
        steps = (before.stride / 2.0, gait.stride / 2.0) if length is None else (length / 2.0, length / 2.0)
        width = 0.5 * (before.half_width + gait.half_width)
        self.step(RIGHT, along_arc(self.body, steps[0], outer * turn), lift, land, width)
        # In a turn the left foot swings longer, by up to 4 frames.
        swing = 0.5 * (before.swing + gait.swing) + 4.0 * min(1.0, abs(turn) / np.radians(90.0))
        pause = 0.5 * (before.double_support + gait.double_support)
        wanted = land + pause + swing + gait.double_support + PASSING * gait.swing - start
        # The hub at the end falls on a whole frame: the foot lands that much later. 1e-9: rounding adds no frame.
        rounded_up = np.ceil(wanted - 1e-9) - wanted
        lift = land + pause
        land = lift + swing + rounded_up
        self.step(LEFT, along_arc(self.body, steps[1], (1.0 - outer) * turn), lift, land, gait.half_width)
        self._pass(gait, land)
        return self

    def stop(self, length: float = 0.56, turn: float = 0.0) -> PlanBuilder:
        """Walk from a passing pose to standing, turned by ``turn`` [rad]: the right foot lands, the left one closes.

        length: from the last body pose to the stand [m].
        """
        gait = self._walking()
        lift, land = self._right_swing()
        final = compose(self.body, np.array([length, 0.0, turn]))
        self.step(RIGHT, final, lift, land)
        lift = land + gait.double_support * 0.8
        self.step(LEFT, final, lift, lift + gait.swing * 0.98)
        return self.stand()

    def stop_turned_left(self, turn: float) -> PlanBuilder:
        """Walk from a passing pose to standing turned left by ``turn`` [rad]: right, left and right foot."""
        gait = self._walking()
        lift, land = self._right_swing()
        start = self.body
        self.step(RIGHT, compose(start, np.array([0.42, 0.0, 0.33 * turn])), lift, land, gait.half_width)
        final = compose(start, np.array([0.66, 0.0, turn]))
        for side in (LEFT, RIGHT):
            lift = self.frame + 0.5 * gait.double_support
            self.step(side, final, lift, lift + gait.swing)
        # The right foot lands flat here, so no heel has to come down; see ``_plants`` of
        # :mod:`crowdsim.motion.synthesis.feet`.
        return self.stand(0.0)

    def start_turned_left(self, gait: Gait, turn: float) -> PlanBuilder:
        """Walk from standing to the passing pose of ``gait`` turned left by ``turn`` [rad], left foot first."""
        way = compose(self.body, np.array([0.0, 0.0, turn]))
        ahead = compose(way, np.array([0.42, 0.0, 0.0]))
        return self._start_to(gait, ahead, self.frame + self.plan.style.soft)

    def start_turned_right(self, gait: Gait, turn: float) -> PlanBuilder:
        """Walk from standing, right foot first, to the passing pose of ``gait`` turned right (``turn`` < 0 [rad])."""
        way = compose(self.body, np.array([0.0, 0.0, turn]))
        lift = self.frame + self.plan.style.soft
        # The right foot is put down with three quarters of the turn.
        first = compose(way, np.array([0.34, 0.0, -0.25 * turn]))
        self.step(RIGHT, first, lift, lift + gait.swing, 0.5 * (gait.half_width + STANDING_HALF_WIDTH))
        ahead = compose(way, np.array([0.34 + 0.48 * gait.stride, 0.0, 0.0]))
        return self._start_to(gait, ahead, self.frame + gait.double_support)

    def _start_to(self, gait: Gait, body: Floats, lift: float) -> PlanBuilder:
        """Add the left foot's step to ``body``, lifting at frame ``lift``, and the passing pose after it.

        The foot lands as much later as the passing pose needs to fall on a whole frame.
        """
        wanted = lift + gait.swing + gait.double_support + PASSING * gait.swing
        # 1e-9: rounding adds no frame.
        land = lift + gait.swing + np.ceil(wanted - 1e-9) - wanted
        self.step(LEFT, body, lift, land, gait.half_width)
        self._pass(gait, land)
        return self

    def stand(self, settle: float | None = None) -> PlanBuilder:
        """Come to rest ``settle`` frames after the last landing, rounded up to a whole frame.

        By default they are the style's ``soft`` frames, after which the heel is down.
        """
        self.frame = float(np.ceil(self.frame + (self.plan.style.soft if settle is None else settle)))
        self.plan.hubs.append(Hub(int(self.frame), "stand", self.body))
        self.gait = None
        return self

    def pause(self, rest: float = 4.0) -> PlanBuilder:
        """Stand for ``rest`` frames between two movements."""
        # The stand that motions share is in the middle of the rest.
        self.stand()
        self.plan.hubs[-1] = Hub(round(self.frame + 0.5 * rest), "stand", self.body)
        self.frame += rest
        return self

    def steps(self, places: list[tuple[int, Floats]], swing: float, pause: float = 0.0) -> PlanBuilder:
        """Add steps, one after another, and stand. ``places`` has the side and the body pose of each.

        Body poses (3,) are relative to the present one. ``swing`` and ``pause`` are the frames that a foot is in the
        air, and those between two steps.
        """
        origin = self.body
        lift = self.frame + self.plan.style.soft
        for side, place in places:
            self.step(side, compose(origin, place), lift, lift + swing)
            lift = self.frame + pause
        return self.stand()

    def side_step(self, side: int, length: float, swing: float, turn: float = 0.0) -> PlanBuilder:
        """Step sideways with the foot ``side`` and close with the other one; the body turns by ``turn`` [rad].

        ``length`` is how far the body goes to that side [m], ``swing`` the number of frames that a foot is in the air.
        """
        sign = 1.0 if side == LEFT else -1.0
        body = compose(self.body, np.array([0.0, sign * length, turn]))
        lift = self.frame + self.plan.style.soft
        self.step(side, body, lift, lift + swing)
        lift = self.frame
        self.step(1 - side, body, lift, lift + swing)
        return self

    def finish(self) -> Plan:
        """Return the plan, with a rest of standing at its end."""
        last = int(np.ceil(self.frame))
        self.plan.hubs.append(Hub(last + REST, "stand", self.body))
        self.plan.frame_count = last + REST + 1
        return self.plan
