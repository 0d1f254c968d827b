"""Events of a timetable: which are due, which wait because an agent is in the way, and their outcomes."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from crowdsim.scenario.timetable import Timetable


@dataclass
class Agenda:
    """Keep track of the events of a run.

    A later event of the same movable replaces one that still waits.
    """

    timetable: Timetable
    """The events, in order of time."""
    steps_per_second: int
    happened: dict[int, float | None] = field(default_factory=dict)
    """By number of each event that was due: time at which it happened [s], None if it did not."""
    waiting: list[int] = field(default_factory=list)
    """Numbers of the events that are due and have not happened yet."""
    _next: int = 0  # number of the first event that is not due yet

    @property
    def over(self) -> bool:
        """Return True if nothing changes any more."""
        return self._next == len(self.timetable.events) and not self.waiting

    def collect(self, step: int) -> bool:
        """Add the events that are due by ``step`` to ``waiting``; return True if any event waits.

        An event is due in the step nearest to its time. It takes the place of a waiting one of the same movable.
        """
        events = self.timetable.events
        while self._next < len(events) and round(events[self._next].at * self.steps_per_second) <= step:
            self.happened[self._next] = None
            movable = events[self._next].movable
            self.waiting = [number for number in self.waiting if events[number].movable != movable]
            self.waiting.append(self._next)
            self._next += 1
        return bool(self.waiting)

    def note(self, number: int, step: int) -> None:
        """Note that an event happens in this step. The caller removes it from ``waiting``."""
        self.happened[number] = step / self.steps_per_second

    def report(self) -> list[dict[str, Any]]:
        """Return for each event that was due its title, time [s], outcome and delay [s].

        The delay is None if it has not happened. The outcome is ``happened``, ``waiting``, or ``overtaken`` by the next
        event of the same movable.
        """
        rows = []
        for number, time in self.happened.items():
            event = self.timetable.events[number]
            outcome = "happened" if time is not None else "waiting" if number in self.waiting else "overtaken"
            # Times are rounded to steps, so that an event may happen half a step before its time: that counts as 0.
            late = None if time is None else max(round(time - event.at, 6), 0.0)
            rows.append({"event": event.title, "at": event.at, "outcome": outcome, "late": late})
        return rows
