"""Commands to a running simulation: each is checked when it is given, waits for its step, and is kept."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from crowdsim.errors import Problem, ScenarioError
from crowdsim.scenario.composing.plain_values import plain_keys
from crowdsim.scenario.environment import read_timetable
from crowdsim.scenario.people.commanded import Called, command_complaint
from crowdsim.scenario.scenario import Scenario
from crowdsim.scenario.schema.commands import Command
from crowdsim.scenario.timetable import Timetable, TimetableReader
from crowdsim.yamlfile.document import Document, Position, dotted
from crowdsim.yamlfile.messages import schema_problems

SOURCE = "command"
"""Name that problems of a command show in place of a file."""


class Commands:
    """Commands of a run in order of time: those of its scenario, and those given while it runs.

    A command is due in the step nearest to its time; those that are due are carried out in order.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self.given = sorted(scenario.commands, key=lambda command: command.at)
        """All commands in order of time, whether their time has come or not."""
        self.called = Called(scenario)
        """Which agents are on call after all these commands."""
        for command in self.given:
            self.called.take(command)
        # Number of commands carried out so far.
        self._obeyed = 0
        # Timetables with the commands carried out so far, and with all commands given (read when first needed).
        self._happened = read_timetable(scenario, scenario.environment.solids, ())
        self._planned: TimetableReader | None = None

    @property
    def over(self) -> bool:
        """Return True if all commands were carried out."""
        return self._obeyed == len(self.given)

    def give(self, at: float, keys: Mapping[str, Any], left: NDArray[np.bool_]) -> None:
        """Add a command for time ``at`` [s], later than all that were carried out.

        ``keys`` are those of the command in a scenario, but for ``at``; ``left`` (N,) says which agents have left.

        Raises
        ------
        ScenarioError
            If it is malformed, or impossible together with all other commands and events.
        """
        plain, _ = plain_keys(keys, SOURCE)
        document = Document(SOURCE, plain, {(): Position(SOURCE)}, complete=True)
        try:
            command = Command.model_validate({**plain, "at": at})
        except ValidationError as error:
            raise ScenarioError(schema_problems(error, document, Command)) from None
        later = bisect_right(self.given, at, key=lambda each: each.at)
        self._require_possible(command, later, left)
        self.given.insert(later, command)
        self.called.take(command)

    def next_on_call(self, group: str, count: int) -> list[int]:
        """Return the next ``count`` agents of a group on call.

        Raises
        ------
        ScenarioError
            If there is no such group, it has not so many left, or ``count`` is not a whole number from 1 on.
        """
        if group not in self.called.on_call:
            known = ", ".join(map(repr, self.called.on_call)) or "there is none with 'on_call: true'"
            _refuse("add.group", f"no group {group!r} is on call; groups on call: {known}")
        if isinstance(count, bool) or not isinstance(count, int | np.integer) or count < 1:
            _refuse("add.count", f"expected a whole number from 1 on, got {count!r}")
        agents = self.called.next_of(group, int(count))
        if len(agents) < count:
            _refuse("add.count", f"{group!r} has {len(agents)} left on call, not {count}; give it a larger 'count'")
        return agents

    def left_on_call(self) -> dict[str, int]:
        """Return how many agents of each group on call are left."""
        return {group: len(self.called.next_of(group, len(all_of))) for group, all_of in self.called.on_call.items()}

    def due(self, step: int) -> list[Command]:
        """Return the commands whose time has come in ``step``, to be carried out now."""
        rate, first = self._scenario.steps_per_second, self._obeyed
        while self._obeyed < len(self.given) and round(self.given[self._obeyed].at * rate) <= step:
            self._obeyed += 1
        due = self.given[first : self._obeyed]
        # Append those that change the place to the timetable, which is in order of time. If the first of them comes
        # before the timetable's last change, read all anew.
        places = [(first + k, command) for k, command in enumerate(due) if command.changes_place]
        if places and places[0][1].at >= self._happened.last:
            for number, command in places:
                self._happened.append(("commands", number), command)
        elif places:
            self._happened = self._read(self.given[: self._obeyed])
        return due

    def timetable(self) -> Timetable:
        """Return the timetable with all commands carried out so far."""
        return self._happened.timetable()

    def _read(self, commands: list[Command]) -> TimetableReader:
        """Return a reader of the timetable of the scenario's events together with some commands."""
        return read_timetable(self._scenario, self._scenario.environment.solids, commands)

    def _require_possible(self, command: Command, place: int, left: NDArray[np.bool_]) -> None:
        """Raise ScenarioError if a command is impossible together with the other ones and the events.

        ``place`` is the index in ``given`` at which it is to come; ``left`` (N,) says which agents have left.
        """
        scenario = self._scenario
        asked = command.commanded
        if asked is not None:
            wrong = command_complaint(scenario, scenario.environment, command, self.called)
            if wrong is not None:
                _refuse(dotted(wrong[0]), wrong[1])
            gone = [agent for agent in asked.agents if left[agent]]
            if gone:
                _refuse(f"{command.action}.agents", f"agent {gone[0]} has left; name only others")
            return
        if scenario.planner == "collision3d":
            _refuse(command.action, "planner 'collision3d' needs a place that never changes")
        if scenario.floor.periodic is not None:
            _refuse(command.action, "a periodic floor cannot be changed during a run")
        # Try it on a timetable with all commands: append it if it comes last, else read all anew. An impossible command
        # does not get into the timetable.
        if self._planned is None:
            self._planned = self._read(self.given)
        if place == len(self.given) and command.at >= self._planned.last:
            complaint = self._planned.append(("commands", place), command)
        else:
            planned = self._read([*self.given[:place], command, *self.given[place:]])
            complaint = planned.wrong[0][1] if planned.wrong else None
            self._planned = self._planned if planned.wrong else planned
        if complaint is not None:
            _refuse(command.action, complaint)


def _refuse(key: str, message: str) -> NoReturn:
    """Raise ScenarioError: ``message`` says what is wrong with the command's ``key``."""
    raise ScenarioError([Problem(SOURCE, None, None, key, message)])
