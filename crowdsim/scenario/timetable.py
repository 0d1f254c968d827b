"""The timetable of a scenario: which things come, move and go, when and where to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import shapely
from shapely.affinity import affine_transform
from shapely.geometry.base import BaseGeometry

from crowdsim.environment.layers import AnySolid
from crowdsim.geometry.planar import rotation
from crowdsim.scenario.schema.events import Event, Move
from crowdsim.scenario.schema.schema import ScenarioFields
from crowdsim.yamlfile.document import Complaint
from crowdsim.yamlfile.messages import nearest

Placing = tuple[float, float, float, float, float, float]
"""Where a thing is: (a, b, d, e, x, y) of the map that takes its outline in the file to where it stands."""

AS_DRAWN: Placing = (1.0, 0.0, 0.0, 1.0, 0.0, 0.0)


def placed(shape: BaseGeometry, placing: Placing) -> BaseGeometry:
    """A shape of the file where it stands."""
    return shape if placing == AS_DRAWN else affine_transform(shape, placing)


@dataclass(frozen=True)
class Movable:
    """A thing that is not there, or not in one place, all the time. placing: at the start, None while absent."""

    name: str
    solids: tuple[AnySolid, ...]
    placing: Placing | None

    def footprint(self, placing: Placing) -> BaseGeometry:
        """Its outline when it stands there."""
        return placed(shapely.union_all([solid.footprint for solid in self.solids]), placing)


@dataclass(frozen=True)
class ScheduledEvent:
    """From ``at`` seconds on a movable (an index) stands at ``placing``, or is gone (None).

    number: its index in the file. title: what it does, as ``close 'door'``.
    """

    at: float
    movable: int
    placing: Placing | None
    number: int
    title: str


@dataclass(frozen=True)
class Timetable:
    """What changes in a run: the things that do, and the events in order of time.

    fixed: obstacles, and closed doors, that never change.
    """

    fixed: tuple[AnySolid, ...]
    movables: tuple[Movable, ...]
    events: tuple[ScheduledEvent, ...]

    def at_start(self) -> tuple[AnySolid, ...]:
        """Solids that are there when the run begins."""
        there = [movable for movable in self.movables if movable.placing is not None]
        return (*self.fixed, *(solid for movable in there for solid in movable.solids))


def read_timetable(
    keys: ScenarioFields, things: Sequence[tuple[str, tuple[AnySolid, ...]]]
) -> tuple[Timetable, list[Complaint]]:
    """Read what the events do to ``things`` (name, solids) and doors, and what is wrong with the events.

    Events count in the order of their times, those of one time in the order of the file.
    """
    order = sorted(range(len(keys.events)), key=lambda number: keys.events[number].at)
    named = {event.subject for event in keys.events if event.insert is None}
    reader = _Reader(keys)
    fixed: list[AnySolid] = []
    for name, solids in things:
        if name in named:
            reader.add(name, solids, AS_DRAWN)
        else:
            fixed += solids
            reader.fixed.add(name)
    for door in keys.doors:
        closed = door.initially == "closed"
        if door.name in named:
            reader.add(door.name, door.solids(), AS_DRAWN if closed else None)
        elif closed:
            fixed += door.solids()
            reader.fixed.add(door.name)
    for number in order:
        reader.read(number, keys.events[number])
    return Timetable(tuple(fixed), tuple(reader.movables), tuple(reader.events)), reader.wrong


class _Reader:
    """Follows the events through time: which thing each name means, and where it stands."""

    def __init__(self, keys: ScenarioFields) -> None:
        self.coming = {event.insert.name: event.at for event in reversed(keys.events) if event.insert is not None}
        self.fixed: set[str] = set()
        self.doors = {door.name for door in keys.doors}
        self.movables: list[Movable] = []
        self.events: list[ScheduledEvent] = []
        self.wrong: list[Complaint] = []
        self.where: dict[str, tuple[int, Placing | None]] = {}
        self.since: dict[str, str] = {}

    def add(self, name: str, solids: tuple[AnySolid, ...], placing: Placing | None) -> None:
        self.where[name] = len(self.movables), placing
        self.movables.append(Movable(name, solids, placing))

    def read(self, number: int, event: Event) -> None:
        action, name = event.action, event.subject
        complaint = self._complaint(event)
        if complaint is not None:
            self.wrong.append((("events", number, action), complaint))
            return
        if event.insert is not None:
            self.add(name, event.insert.solids(), None)
        movable, placing = self.where[name]
        if event.move is not None:
            assert placing is not None
            after: Placing | None = _moved(self.movables[movable], placing, event.move)
        else:
            after = AS_DRAWN if action in ("close", "insert") else None
        self.where[name] = movable, after
        self.since[name] = f"since {event.at:g} s"
        self.events.append(ScheduledEvent(event.at, movable, after, number, f"{action} '{name}'"))

    def _complaint(self, event: Event) -> str | None:
        """Why an event cannot be, or None."""
        action, name = event.action, event.subject
        there = name in self.where and self.where[name][1] is not None
        since = self.since.get(name, "from the start")
        if action in ("open", "close"):
            if name not in self.doors:
                if name in {*self.where, *self.fixed}:
                    return f"'{name}' is an obstacle; list it under 'doors'"
                return f"no door '{name}'; {nearest(name, sorted(self.doors), 'the doors are')}"
            if there == (action == "close"):
                return f"'{name}' is {'closed' if there else 'open'} already, {since}"
            return None
        if name in self.doors:
            return f"'{name}' is a door; doors open and close"
        if action == "insert":
            if there or name in self.fixed:
                return f"the name '{name}' is taken by something that is there, {since}"
            return None
        if there:
            return None
        if name in self.where:
            return f"'{name}' is not there at {event.at:g} s; it is gone {since}"
        if name in self.coming:
            return f"'{name}' is not there at {event.at:g} s; it comes at {self.coming[name]:g} s"
        return f"no obstacle '{name}'; {nearest(name, sorted({*self.fixed, *self.where} - self.doors), 'there are')}"


def _moved(movable: Movable, placing: Placing, move: Move) -> Placing:
    """The placing after a move: turned about the center where it stands, then shifted."""
    outline = movable.footprint(placing)
    if outline.is_empty:  # a file of which nothing stands on the floor
        return placing
    center = outline.centroid
    dx, dy = move.by or (0.0, 0.0)
    if move.to is not None:
        dx, dy = move.to[0] - center.x, move.to[1] - center.y
    cosine, sine = rotation(move.rotation)
    a, b, d, e, x, y = placing
    x, y = x - center.x, y - center.y
    return (
        cosine * a - sine * d,
        cosine * b - sine * e,
        sine * a + cosine * d,
        sine * b + cosine * e,
        cosine * x - sine * y + center.x + dx,
        sine * x + cosine * y + center.y + dy,
    )
