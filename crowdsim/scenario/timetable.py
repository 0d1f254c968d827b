"""The timetable of a scenario: which things appear, move and disappear, when, and where to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import shapely
from shapely.affinity import affine_transform
from shapely.geometry.base import BaseGeometry

from crowdsim.environment.layers import AnySolid
from crowdsim.geometry.planar import rotation
from crowdsim.scenario.schema.commands import Command
from crowdsim.scenario.schema.events import Event, Move
from crowdsim.scenario.schema.schema import ScenarioFields
from crowdsim.yamlfile.document import Complaint
from crowdsim.yamlfile.document import Path as KeyPath
from crowdsim.yamlfile.messages import nearest

Placing = tuple[float, float, float, float, float, float]
"""Position of a thing: coefficients (a, b, d, e, x0, y0) of the affine map from a point (x, y) of its outline in the
file to the place (a x + b y + x0, d x + e y + y0) at which it stands [m]."""

AS_DRAWN: Placing = (1.0, 0.0, 0.0, 1.0, 0.0, 0.0)
"""Placing of a thing where the file draws it."""


def placed(shape: BaseGeometry, placing: Placing) -> BaseGeometry:
    """Return a shape of the file, moved to ``placing``."""
    return shape if placing == AS_DRAWN else affine_transform(shape, placing)


@dataclass(frozen=True)
class Movable:
    """A thing that may move, appear or disappear during a run.

    Attributes
    ----------
    name : str
        Name in the file.
    solids : tuple of solids
        Solids as the file draws them.
    placing : Placing or None
        Position at the start; None if it is absent then.
    """

    name: str
    solids: tuple[AnySolid, ...]
    placing: Placing | None

    def footprint(self, placing: Placing) -> BaseGeometry:
        """Return the thing's outline on the floor [m] if it stands at ``placing``."""
        return placed(shapely.union_all([solid.footprint for solid in self.solids]), placing)


@dataclass(frozen=True)
class ScheduledEvent:
    """A change of one movable thing.

    Attributes
    ----------
    at : float
        Time of the change [s].
    movable : int
        Index of the thing.
    placing : Placing or None
        Its position from then on; None if it disappears.
    title : str
        The change in words, as ``close 'door'``.
    """

    at: float
    movable: int
    placing: Placing | None
    title: str


@dataclass(frozen=True)
class Timetable:
    """All changes of the environment during a run.

    Attributes
    ----------
    fixed : tuple of solids
        Obstacles and closed doors that never change.
    movables : tuple of Movable
        Things that may change.
    events : tuple of ScheduledEvent
        Changes in the order of time.
    """

    fixed: tuple[AnySolid, ...]
    movables: tuple[Movable, ...]
    events: tuple[ScheduledEvent, ...]

    def at_start(self) -> tuple[AnySolid, ...]:
        """Return the solids that are present when the run begins."""
        there = [movable for movable in self.movables if movable.placing is not None]
        return (*self.fixed, *(solid for movable in there for solid in movable.solids))


class TimetableReader:
    """Reads events in the order of time: which thing each name refers to, and where it then stands.

    Events of one time keep the order of the file. Movables are, in the order of the file: things that an event names or
    that are marked ``movable``, doors, and inserted things. With the planner ``collision3d``, a door that no event
    names is no movable: it is fixed if it is closed, and left out if it is open. A command never makes a fixed thing
    movable, and things that commands insert get the last indices, so that commands leave the indices of other movables
    unchanged.

    Parameters
    ----------
    keys : ScenarioFields
        Keys of the scenario.
    things : sequence of (name, solids)
        Obstacles and clutter.
    commands : sequence of Command
        Commands, in the order of time among the events of the file, and after those of the same time.

    Attributes
    ----------
    wrong : list of Complaint
        What is wrong with events and commands; these are left out of the timetable.

    Notes
    -----
    ``path`` in methods is the key path of an event or a command, as ``("events", 2)``.
    """

    def __init__(
        self,
        keys: ScenarioFields,
        things: Sequence[tuple[str, tuple[AnySolid, ...]]],
        commands: Sequence[Command] = (),
    ) -> None:
        self.wrong: list[Complaint] = []
        # When a thing of a name is first inserted: latest first, so that the earliest event of a name counts.
        latest_first = sorted(keys.events, key=lambda event: event.at, reverse=True)
        self._coming = {event.insert.name: event.at for event in latest_first if event.insert is not None}
        self._doors = {door.name for door in keys.doors}
        self._fixed: list[AnySolid] = []
        self._fixed_names: set[str] = set()
        self._movables: list[Movable] = []
        self._inserted: dict[KeyPath, int] = {}
        self._events: list[ScheduledEvent] = []
        # Index and present placing of each movable by name, and since when it is so, in words.
        self._where: dict[str, tuple[int, Placing | None]] = {}
        self._since: dict[str, str] = {}
        self._place(keys, things)
        entries: list[tuple[KeyPath, Event]] = [(("events", number), event) for number, event in enumerate(keys.events)]
        entries += [(("commands", number), command) for number, command in enumerate(commands) if command.changes_place]
        for path, event in entries:
            self._number(path, event)
        for path, event in sorted(entries, key=lambda entry: entry[1].at):
            self._read(path, event)

    @property
    def last(self) -> float:
        """Return the time of the last event [s]; 0 without events."""
        return self._events[-1].at if self._events else 0.0

    def timetable(self) -> Timetable:
        """Return the timetable of everything read so far."""
        return Timetable(tuple(self._fixed), tuple(self._movables), tuple(self._events))

    def append(self, path: KeyPath, command: Command) -> str | None:
        """Read a command about a door or an obstacle, later than all events read so far.

        Return None; or why it is impossible, in which case it is not added.
        """
        complaint = self._complaint(command)
        if complaint is None:
            self._number(path, command)
            self._read(path, command)
        return complaint

    def _place(self, keys: ScenarioFields, things: Sequence[tuple[str, tuple[AnySolid, ...]]]) -> None:
        """Sort things and doors into fixed ones and movables."""
        named = {event.subject for event in keys.events if event.insert is None}
        moves = named | {obstacle.name for obstacle in keys.obstacles if obstacle.movable}
        for name, solids in things:
            if name in moves:
                self._add(name, solids, AS_DRAWN)
            else:
                self._fixed += solids
                self._fixed_names.add(name)
        for door in keys.doors:
            closed = door.initially == "closed"
            # The collision3d planner tests bodies against fixed solids only: a door without events becomes fixed.
            if door.name in named or keys.planner != "collision3d":
                self._add(door.name, door.solids(), AS_DRAWN if closed else None)
            elif closed:
                self._fixed += door.solids()
                self._fixed_names.add(door.name)

    def _add(self, name: str, solids: tuple[AnySolid, ...], placing: Placing | None) -> None:
        """Add a movable that stands at ``placing`` at the start; None if it is absent then."""
        self._where[name] = len(self._movables), placing
        self._movables.append(Movable(name, solids, placing))

    def _number(self, path: KeyPath, event: Event) -> None:
        """Add the thing that an event inserts to the movables, absent at first, in the order of the file."""
        if event.insert is not None:
            self._inserted[path] = len(self._movables)
            self._movables.append(Movable(event.insert.name, event.insert.solids(), None))

    def _read(self, path: KeyPath, event: Event) -> None:
        """Add an event, and where its movable stands from then on; or keep what is wrong with it."""
        action, name = event.action, event.subject
        complaint = self._complaint(event)
        if complaint is not None:
            self.wrong.append(((*path, action), complaint))
            return
        if event.insert is not None:
            self._where[name] = self._inserted[path], None
        movable, placing = self._where[name]
        if event.move is not None:
            assert placing is not None
            after: Placing | None = _moved(self._movables[movable], placing, event.move)
        else:
            after = AS_DRAWN if action in ("close", "insert") else None
        self._where[name] = movable, after
        self._since[name] = f"since {event.at:g} s"
        self._events.append(ScheduledEvent(event.at, movable, after, f"{action} '{name}'"))

    def _complaint(self, event: Event) -> str | None:
        """Return why an event is impossible, or None."""
        action, name = event.action, event.subject
        there = name in self._where and self._where[name][1] is not None
        since = self._since.get(name, "from the start")
        if action in ("open", "close"):
            if name not in self._doors:
                if name in {*self._where, *self._fixed_names}:
                    return f"'{name}' is an obstacle; list it under 'doors'"
                return f"no door '{name}'; {nearest(name, sorted(self._doors), 'the doors are')}"
            # A closed door is there, an open one is not.
            if there == (action == "close"):
                return f"'{name}' is {'closed' if there else 'open'} already, {since}"
            return None
        if name in self._doors:
            return f"'{name}' is a door; doors open and close"
        if action == "insert":
            if there or name in self._fixed_names:
                return f"the name '{name}' is taken by something that is there, {since}"
            return None
        # The action is ``move`` or ``remove``: a movable must be there. The rest finds the reason why it is not.
        if there:
            return None
        if name in self._where:
            return f"'{name}' is not there at {event.at:g} s; it is gone {since}"
        if name in self._coming:
            return f"'{name}' is not there at {event.at:g} s; it comes at {self._coming[name]:g} s"
        if name in self._fixed_names:
            return f"'{name}' never changes; give it 'movable: true', so that commands may move and remove it"
        known = sorted({*self._fixed_names, *self._where} - self._doors)
        return f"no obstacle '{name}'; {nearest(name, known, 'there are')}"


def _moved(movable: Movable, placing: Placing, move: Move) -> Placing:
    """Return the placing after a move: rotated about the current center, then shifted."""
    outline = movable.footprint(placing)
    if outline.is_empty:  # a file without any part above the floor has no center to turn about
        return placing
    center = outline.centroid
    dx, dy = move.by or (0.0, 0.0)
    if move.to is not None:
        dx, dy = move.to[0] - center.x, move.to[1] - center.y
    # The map of the placing, then the rotation about the center, then the shift.
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
