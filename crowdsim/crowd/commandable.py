"""Commands that a program or a system gives to a simulation."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from crowdsim.crowd.agents import Agents
from crowdsim.crowd.commands import Commands
from crowdsim.crowd.crowd import Crowd
from crowdsim.recording.header import AgentState
from crowdsim.scenario.people.new_goals import places_in
from crowdsim.scenario.scenario import Scenario
from crowdsim.scenario.schema.commands import Added, Command, NewGoal, NewSpeed
from crowdsim.scenario.schema.values import Part


class Commandable(ABC):
    """The part of a simulation that own systems read, and to which they give commands.

    Each command is carried out with the next step. Commands that change the place raise ScenarioError if the floor is
    periodic, or the planner is ``collision3d``.
    """

    def __init__(self, scenario: Scenario, crowd: Crowd) -> None:
        self.scenario = scenario
        self.crowd = crowd
        self._commands = Commands(scenario)
        self._removed = np.zeros(crowd.count, np.bool_)
        self._carried_out: list[Command] = []

    @property
    @abstractmethod
    def agents(self) -> Agents:
        """Return all agents as the last step left them."""

    @property
    def step_count(self) -> int:
        """Return the number of steps taken so far."""
        return self.crowd.step_count

    @property
    def time(self) -> float:
        """Return the time of the scenario that the steps so far took [s]."""
        return self.step_count / self.scenario.steps_per_second

    def set_goal(
        self, agents: int | Sequence[int] | NDArray[Any], goal: Any, on_arrival: Literal["leave", "stay"] = "leave"
    ) -> None:
        """Send agents to another goal with the next step, instead of all their goals.

        Agents that have not entered yet go there when they enter; members of parties go each on its own. A captured
        agent whose last steps out of the world are reserved leaves all the same.

        Parameters
        ----------
        agents : int or sequence of int
            Numbers of the agents, in the order of :attr:`agents`.
        goal : (x, y), Polygon or mapping
            A point [m], a polygon of shapely, or the keys of a region in a scenario.
        on_arrival : "leave" or "stay"
            If they leave the world there or stay.

        Raises
        ------
        ScenarioError
            If there is no such agent, one has left, no agent can stand in the goal (to stay: not all of them can), or
            the floor is periodic.
        """
        self._give(set_goal={"agents": _numbers(agents), "goal": _region(goal), "on_arrival": on_arrival})

    def add(self, group: str, count: int = 1, start: Any = None) -> NDArray[np.int64]:
        """Let agents of a group with ``on_call: true`` come with the next step, or as soon as there is room.

        They go where their group goes, unless :meth:`set_goal` sends them elsewhere.

        Parameters
        ----------
        group : str
            Name of the group.
        count : int
            How many agents come.
        start : (x, y), Polygon or mapping, optional
            A point [m], a polygon of shapely, or the keys of a region; by default, agents start where their group does.

        Returns
        -------
        (count,) int64
            Numbers of the agents.

        Raises
        ------
        ScenarioError
            If there is no such group on call, it has not so many agents left, or no agent can stand in ``start``.
        """
        agents = self._commands.next_on_call(group, count)
        self._give(add={"agents": agents} if start is None else {"agents": agents, "start": _region(start)})
        return np.array(agents, np.int64)

    def remove(self, agents: int | Sequence[int] | NDArray[Any]) -> None:
        """Take agents out of the world with the next step; those who are yet to come never come.

        Parameters
        ----------
        agents : int or sequence of int
            Numbers of the agents.

        Raises
        ------
        ScenarioError
            If there is no such agent, or one has left.
        """
        self._give(remove_agents={"agents": _numbers(agents)})

    def set_speed(self, agents: int | Sequence[int] | NDArray[Any], speed: float) -> None:
        """Let agents walk at another speed, if nothing is in their way.

        Those who steer take it with the next step, captured ones with the next nodes that they reserve, within a second
        or two.

        Parameters
        ----------
        agents : int or sequence of int
            Numbers of the agents.
        speed : float
            Speed [m/s], 0.1 to 3; ``captured`` agents walk at the nearest one that their motion can be played at.

        Raises
        ------
        ScenarioError
            If there is no such agent, one has left, or the speed is out of range.
        """
        self._give(set_speed={"agents": _numbers(agents), "speed": speed})

    def open_door(self, name: str) -> None:
        """Open a door with the next step.

        Parameters
        ----------
        name : str
            Name of the door.

        Raises
        ------
        ScenarioError
            If there is no such door, it is open, or a later event would become impossible.
        """
        self._give(open=name)

    def close_door(self, name: str) -> None:
        """Close a door with the next step, or as soon as no agent is in the way.

        Parameters
        ----------
        name : str
            Name of the door.

        Raises
        ------
        ScenarioError
            If there is no such door, it is closed or a command closes it already, or a later event would become
            impossible.
        """
        self._give(close=name)

    def insert(self, obstacle: Mapping[str, Any]) -> None:
        """Insert an obstacle with the next step, or as soon as no agent is in the way.

        Parameters
        ----------
        obstacle : mapping
            The keys of an obstacle in a scenario, as ``{"name": "crate", "polygon": polygon, "top": 0.6}``.

        Raises
        ------
        ScenarioError
            If it is malformed, its name is taken, or a later event would become impossible.
        """
        self._give(insert=obstacle)

    def move(
        self,
        name: str,
        by: tuple[float, float] | None = None,
        to: tuple[float, float] | None = None,
        rotation: float = 0.0,
    ) -> None:
        """Move or turn an obstacle with the next step, or as soon as no agent is in the way.

        Parameters
        ----------
        name : str
            Name of an obstacle that may change: it was inserted, an event names it, or it is ``movable``.
        by : (float, float), optional
            Displacement (x, y) [m].
        to : (float, float), optional
            New center (x, y) [m]; not together with ``by``.
        rotation : float
            Turn about the center, counterclockwise [degrees].

        Raises
        ------
        ScenarioError
            If there is no such obstacle at that time, it never changes, neither a new position nor a turn is given,
            both ``by`` and ``to`` are, or a later event would become impossible.
        """
        keys = {"name": name, "by": by, "to": to, "rotation": rotation or None}
        self._give(move={key: value for key, value in keys.items() if value is not None})

    def remove_obstacle(self, name: str) -> None:
        """Remove an obstacle with the next step.

        Parameters
        ----------
        name : str
            Name of the obstacle.

        Raises
        ------
        ScenarioError
            If there is no such obstacle at that time, it never changes, or a later event would become impossible.
        """
        self._give(remove=name)

    @property
    def _left(self) -> NDArray[np.bool_]:
        """Return which agents (N,) have left: they have arrived and are not in the world, or were removed."""
        return np.asarray(self._removed | (self.crowd.arrivals >= 0) & (self.agents.state == AgentState.ABSENT))

    def _give(self, **keys: Any) -> None:
        """Give a command, by its keys in a scenario, for the next step that can carry it out."""
        self._commands.give(self._step_of_commands() / self.scenario.steps_per_second, keys, self._left)

    @abstractmethod
    def _step_of_commands(self) -> int:
        """Return the number of the step that carries out commands given now; raise CrowdSimError if there is none."""

    def _carry_out(self) -> None:
        """Carry out the commands that are due, and keep them in ``_carried_out``, for the recording.

        The crowd gets a new timetable if one of them changes the place.
        """
        due = self._carried_out = self._commands.due(self.step_count)
        if any(command.changes_place for command in due):
            self.crowd.take_timetable(self._commands.timetable())
        for command in due:
            self._obey(command)

    def _obey(self, command: Command) -> None:
        """Carry out a command about agents, without those that have left since it was given.

        Nothing is to be done for a command that changes the place: the timetable has its change.
        """
        asked = command.commanded
        if asked is None:
            return
        agents = np.array(sorted(set(asked.agents)), np.int64)
        here = ~self._left[agents]
        if not here.any():
            return
        match asked:
            case NewGoal():
                region, places = places_in(self.scenario.environment, asked.goal, len(agents))
                # If agents leave there, there may be fewer places than agents: some get the same one.
                own = places[np.arange(len(agents)) % len(places)]
                self.crowd.set_goal(agents[here], region, own[here], asked.on_arrival == "stay")
            case Added():
                starts = None
                if asked.start is not None:
                    places = places_in(self.scenario.environment, asked.start, len(agents)).places
                    # There may be fewer places than agents: those with the same one come one after another.
                    starts = places[np.arange(len(agents)) % len(places)][here]
                self.crowd.add(agents[here], starts)
            case NewSpeed(speed=speed):
                self.crowd.set_speed(agents[here], speed)
            # The only other command removes agents.
            case _:
                self.crowd.remove(agents[here])
                self._removed[agents[here]] = True


def _numbers(agents: Any) -> Any:
    """Return the numbers of agents as a command lists them."""
    return [agents] if isinstance(agents, int | np.integer) else agents


def _region(place: Any) -> Any:
    """Return a place as the region of a command: (x, y) is a point, polygons and keys are as they are."""
    return place if isinstance(place, Mapping | BaseGeometry | Part) else {"point": place}
