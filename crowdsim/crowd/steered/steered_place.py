"""Place of a steered crowd: walls to keep off, and fields to the goals; both change with events."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from crowdsim.behaviors.behavior import Behavior
from crowdsim.constants import TRACKING_MARGIN
from crowdsim.crowd.ranks.protocol import ONE_RANK, Ranks
from crowdsim.crowd.state.agenda import Agenda
from crowdsim.crowd.state.environment import Footprints, footprints_of, state_of
from crowdsim.planning.query.requirements import Requirements
from crowdsim.scenario.environment import Environment
from crowdsim.scenario.timetable import Placing
from crowdsim.steering.guidance.field import asked_of
from crowdsim.steering.guidance.ground import build_ground, update_ground
from crowdsim.steering.guidance.guidance import Guidance
from crowdsim.steering.guidance.place_walls import Bounds, PlaceWalls, outline_segments
from crowdsim.steering.row_kernels import ROW
from crowdsim.steering.walls import Walls

KEPT_OFF = 0.02
"""Gap to a body below which a movable does not appear [m]."""


_READ = ("x", "y", "goal", "stuck", "opposed", "share", "vx", "vy", "gx", "gy", "speed")

WALKING = np.dtype([*((name, ROW[name]) for name in _READ), ("following", np.int32)])
"""What the renewal of a field reads of an agent: columns of ROW, and the field that it follows."""


class SteeredPlace:
    """Walls and guidance of a place, as they are now.

    Parameters
    ----------
    environment : Environment
        Floor, layers and timetable.
    goals : sequence of Polygon
        Regions of the goals [m].
    behaviors : sequence of Behavior
        Behaviors of the agents, least preferred first.
    steps_per_second : int
        Rate of the steps.
    threads : int
        Number of threads that solve fields; the result does not depend on it.
    ranks : Ranks
        The processes that share the run.
    own : (m,) bool, optional
        Goals whose agents get ways of their own; none by default.
    """

    def __init__(
        self,
        environment: Environment,
        goals: Sequence[Polygon],
        behaviors: Sequence[Behavior],
        steps_per_second: int,
        threads: int,
        ranks: Ranks = ONE_RANK,
        own: NDArray[np.bool_] | None = None,
    ) -> None:
        self._ranks = ranks
        timetable = environment.timetable
        self.agenda = Agenda(timetable, steps_per_second)
        self._layers = environment.fixed_layers
        # Placings of the movables that are present, by their numbers.
        self._placings = {k: each.placing for k, each in enumerate(timetable.movables) if each.placing is not None}
        things = {number: self._footprints(number, at) for number, at in self._placings.items()}
        self._walls = PlaceWalls([layer.free for layer in self._layers], things)
        self._need = _needs_of(behaviors, len(self._layers))
        self._prescribed = Requirements.of(behaviors, len(self._layers), TRACKING_MARGIN).radii
        ground = build_ground(self._walls.segments().layers, self._need, prescribed=self._prescribed)
        self.asked = asked_of(behaviors)
        self.guidance = Guidance(ground, goals, self.asked, own=own, threads=threads)
        self._steps_per_second = steps_per_second
        # What movables that wait to appear are to cover; by number of the event, as the next event of the same movable
        # may place it elsewhere.
        self._announced: dict[int, Footprints] = {}
        # Union of all movables present.
        self._standing = _union([*things.values()])

    @property
    def bounds(self) -> Bounds:
        """Return left, bottom, right and top of the place [m]."""
        return self._walls.bounds

    @property
    def walls(self) -> tuple[Walls, Walls]:
        """Return the walls of the legs' layer, and those of the layers above."""
        return self._walls.legs, self._walls.torso

    @property
    def memory(self) -> int:
        """Return the bytes of walls, ground and fields."""
        return self.guidance.memory + sum(_bytes_of(walls) for walls in self.walls)

    def placing(self, movable: int) -> Placing | None:
        """Return the placing of a movable; None while it is absent."""
        return self._placings.get(movable)

    def state(self) -> bytes:
        """Return numbers and placings of all movables present, for the state hash; empty if there are none."""
        return state_of(self._placings)

    def apply_events(self, step: int, state: NDArray[Any]) -> bool:
        """Let due events happen if no body of ``state`` (ROW[n]) is in the way; return True if walls changed.

        An event that has to wait is announced: fields already lead around it, so that all agents leave its place.
        """
        agenda = self.agenda
        if not agenda.collect(step):
            return False
        waiting, happening = [], []
        for number in agenda.waiting:
            event = agenda.timetable.events[number]
            # An event that removes a movable (no placing) never has to wait.
            taken = None if event.placing is None else self._footprints(event.movable, event.placing)
            if taken is not None and self._ranks.any(self.is_taken(taken, state)):
                waiting.append(number)
                continue
            agenda.note(number, step)
            happening.append(number)
        agenda.waiting = waiting
        return self.change(happening, waiting)

    def is_taken(self, taken: Footprints, state: NDArray[Any]) -> bool:
        """Return True if a body of ``state`` (ROW[n]) is within KEPT_OFF of a movable that is to cover ``taken``."""
        outline = shapely.union_all([shape for shape in taken if shape])
        return bool((shapely.distance(_cores(state), outline) < state["radius"] + KEPT_OFF).any())

    def change(self, happening: Sequence[int], waiting: Sequence[int]) -> bool:
        """Let some events happen and announce those that wait; return True if walls changed.

        ``happening`` and ``waiting`` are numbers of events. The ground is updated within the window (left, bottom,
        right, top) of all that has changed, is announced for the first time, or is no longer announced; then all fields
        are solved anew.
        """
        events = self.agenda.timetable.events
        announced: dict[int, Footprints] = {}
        for number in waiting:
            placing = events[number].placing
            if placing is not None:
                announced[number] = self._footprints(events[number].movable, placing)
        windows: list[Bounds] = []
        stands_elsewhere = moved = False
        for number in happening:
            event = events[number]
            # An event that leaves the movable as it is changes nothing.
            if event.placing != self.placing(event.movable):
                taken = None
                if event.placing is None:
                    del self._placings[event.movable]
                else:
                    taken = self._footprints(event.movable, event.placing)
                    self._placings[event.movable] = event.placing
                moved = True
                # Without a window it has no part on any layer, before or after: walls stay as they are.
                window = self._walls.put(event.movable, taken)
                if window is not None:
                    windows.append(window)
                    stands_elsewhere = True
        if moved:
            self._standing = self._union_of_things()
        # Events announced for the first time, and those no longer announced, change the fields, too.
        either = {**announced, **self._announced}
        windows += [_window_of(either[number]) for number in sorted(announced.keys() ^ self._announced.keys())]
        self._announced = announced
        if windows:
            low, high = np.min(windows, axis=0).tolist(), np.max(windows, axis=0).tolist()
            self._guide_anew((low[0], low[1], high[2], high[3]))
        return stands_elsewhere

    def covers(self, places: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which positions (n, 2) [m] are inside of a movable that is present; no agent can enter there."""
        return np.asarray(shapely.contains_xy(self._standing, places))

    def leads_straight(self, places: NDArray[np.float64], others: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return for which rows no wall is on the straight line from ``places`` to ``others``, both (n, 2) [m].

        Walls are those of the lowest layer, and all movables present.
        """
        lines = shapely.linestrings(np.stack((places, others), 1))
        free = self._layers[0].free
        shapely.prepare(free)
        return np.asarray(shapely.covers(free, lines) & ~shapely.intersects(self._standing, lines))

    def announces(self, places: NDArray[np.float64], reach: float) -> NDArray[np.bool_]:
        """Return which positions (n, 2) [m] are within ``reach`` [m] of a movable that waits to appear."""
        if not self._announced:
            return np.zeros(len(places), np.bool_)
        outline = _union(list(self._announced.values()))
        return np.asarray(shapely.dwithin(outline, shapely.points(places), reach))

    def lead_out(self, state: NDArray[Any], lost: NDArray[np.int64]) -> None:
        """Lead rows that have no path straight away from where a movable waits to appear, if they are in its way.

        ``lost`` (k,) are the rows of ``state`` (ROW[n]) without a path; ``gx`` and ``gy`` of those in the way change.
        Rows are in the way inside of the movable's outline and up to 0.5 m from it: fields lead around the outline with
        a clearance, so that bodies just outside may have no path.
        """
        if not self._announced or not len(lost):
            return
        outline = _union(list(self._announced.values()))
        places = shapely.points(state["x"][lost], state["y"][lost])
        inside = shapely.contains(outline, places)
        near = inside | (shapely.distance(outline, places) < 0.5)
        ends = shapely.get_coordinates(shapely.shortest_line(places, outline.boundary)).reshape(-1, 2, 2)
        # Head for the nearest point of the outline; from outside, in the opposite direction. On the outline itself
        # there is no direction.
        away = np.where(inside[:, None], 1.0, -1.0) * (ends[:, 1] - ends[:, 0])
        length = np.sqrt((away * away).sum(axis=1))
        go = near & (length > 0.0)
        rows = lost[go]
        state["gx"][rows], state["gy"][rows] = (away[go] / length[go][:, None]).T

    def refresh(self, step: int, state: NDArray[Any], following: NDArray[np.int32]) -> None:
        """If it is time, renew the field to the goal whose turn it is, in the present crowd; agents may change to it.

        ``state`` (ROW[n]) are the agents of this process; ``following`` (n,), the numbers of the fields that they
        follow, is updated.
        """
        if self._ranks.size == 1:
            self.guidance.refresh_in_turn(step, self._steps_per_second, state, following)
            return
        # The same answer in all processes, as it depends on the step alone: no exchange in vain.
        if not self.guidance.is_turn(step, self._steps_per_second):
            return
        # All processes renew the same field and find the same ways, in the crowd of all of them.
        walking = np.empty(len(state), WALKING)
        for name in _READ:
            walking[name] = state[name]
        walking["following"] = following
        everybody, mine = self._ranks.together(walking)
        followed = everybody["following"].copy()
        self.guidance.refresh_in_turn(step, self._steps_per_second, everybody, followed)
        following[:] = followed[mine]

    def _footprints(self, movable: int, placing: Placing) -> Footprints:
        """Return the area that a movable covers on each layer if it stands at ``placing``, None for no area."""
        return footprints_of(self.agenda.timetable.movables[movable], self._layers, placing)

    def _union_of_things(self) -> BaseGeometry:
        """Return the union of the areas of all movables present, on any layer."""
        return _union([self._footprints(number, self._placings[number]) for number in sorted(self._placings)])

    def _guide_anew(self, window: Bounds) -> None:
        """Update the ground within a window, with all that is present or announced, and solve all fields anew."""
        announced = [self._announced[number] for number in sorted(self._announced)]
        layers = [
            np.concatenate([segments, *(outline_segments(taken[k]) for taken in announced)])
            for k, segments in enumerate(self._walls.segments().layers)
        ]
        self.guidance.rebuild(
            update_ground(self.guidance.ground, layers, self._need, window, prescribed=self._prescribed)
        )


def _needs_of(behaviors: Sequence[Behavior], layers: int) -> Requirements:
    """Return the clearances of ways: those of the bodies alone, but none less than that planned for the narrowest one.

    So agents steer through the same gaps as captured ones, and keep no farther off walls there than they have to. The
    clearances from which on behaviors are prescribed are others: those planned for captured agents.
    """
    planned = Requirements.of(behaviors, layers, TRACKING_MARGIN)
    return replace(planned, radii=np.maximum(planned.radii[0], Requirements.of(behaviors, layers, 0.0).radii))


def _union(things: Sequence[Footprints]) -> BaseGeometry:
    """Return the union of the areas of some movables on any layer, prepared for queries."""
    union: BaseGeometry = shapely.union_all([shape for taken in things for shape in taken if shape])
    shapely.prepare(union)
    return union


def _bytes_of(arrays: Sequence[Any]) -> int:
    """Return the bytes of the arrays among some values, such as the fields of Walls."""
    return sum(each.nbytes for each in arrays if isinstance(each, np.ndarray))


def _cores(state: NDArray[Any]) -> Any:
    """Return the cores of bodies (ROW[n]) as lines (n,), from shoulder to shoulder."""
    half = state["half"][:, None] * np.column_stack((-state["hy"], state["hx"]))
    place = np.column_stack((state["x"], state["y"]))
    return shapely.linestrings(np.stack([place - half, place + half], axis=1))


def _window_of(taken: Sequence[BaseGeometry | None]) -> Bounds:
    """Return left, bottom, right and top of the areas of a movable on all layers together [m]; None is no area."""
    bounds: Bounds = tuple(shapely.total_bounds([shape for shape in taken if shape]).tolist())
    return bounds
