"""Events of a timetable: which are due, which wait as somebody is in the way, and what became of each."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from crowdsim.scenario.timetable import Timetable


@dataclass
class Agenda:
    """Keeps the events of a run.

    A later event of the same thing takes the place of one that still waits. happened: seconds at which each event that
    was due happened, None for one that did not, by its index. waiting: indices of those that are due and did not yet.
    """

    timetable: Timetable
    steps_per_second: int
    happened: dict[int, float | None] = field(default_factory=dict)
    waiting: list[int] = field(default_factory=list)
    _next: int = 0

    @property
    def over(self) -> bool:
        """Whether nothing changes any more."""
        return self._next == len(self.timetable.events) and not self.waiting

    def collect(self, step: int) -> bool:
        """Let events whose time has come wait to happen; returns whether any waits."""
        events = self.timetable.events
        while self._next < len(events) and round(events[self._next].at * self.steps_per_second) <= step:
            self.happened[self._next] = None
            movable = events[self._next].movable
            self.waiting = [number for number in self.waiting if events[number].movable != movable]
            self.waiting.append(self._next)
            self._next += 1
        return bool(self.waiting)

    def note(self, number: int, step: int) -> None:
        """Note that an event happens in this step; it is for the caller to take it off ``waiting``."""
        self.happened[number] = step / self.steps_per_second

    def report(self) -> list[dict[str, Any]]:
        """Every event that was due: what, when, what became of it, and how many seconds late, None if never.

        It ``happened``, is ``waiting`` still, or was ``overtaken`` by the next event of the same thing.
        """
        rows = []
        for number, time in self.happened.items():
            event = self.timetable.events[number]
            outcome = "happened" if time is not None else "waiting" if number in self.waiting else "overtaken"
            late = None if time is None else max(round(time - event.at, 6), 0.0)
            rows.append({"event": event.title, "at": event.at, "outcome": outcome, "late": late})
        return rows
