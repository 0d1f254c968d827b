"""Carry out the requests that are commands to the simulation."""

from __future__ import annotations

from crowdsim.crowd.simulation import Simulation
from crowdsim.errors import ScenarioError
from crowdsim.live.requests import (
    Add,
    DrawWall,
    Move,
    RemoveAgents,
    RemoveObstacle,
    Request,
    RequestRefused,
    SetDoor,
    SetGoal,
)

_WALL_NAME = "drawn wall"
_WALL_TOP = 2.5
_WALL_THICKNESS = 0.12
"""Height and thickness of walls that are drawn [m]."""


def command(simulation: Simulation, request: Request) -> str:
    """Carry out a request for a command; return in words what was done.

    Raises
    ------
    RequestRefused
        With the reason, if the command is impossible or the request is for none.
    """
    try:
        return _given(simulation, request)
    except ScenarioError as error:
        raise RequestRefused("; ".join(problem.message for problem in error.problems)) from None


def _given(simulation: Simulation, request: Request) -> str:
    """Give the command of a request to the simulation; return in words what it does."""
    match request:
        case SetGoal():
            simulation.set_goal(request.agents, request.goal, request.on_arrival)
            return f"{_characters(request.agents)} goes to {_point(request.goal)}"
        case RemoveAgents():
            simulation.remove(request.agents)
            return f"{_characters(request.agents)} is taken out"
        case Add():
            if not simulation.on_call():
                raise RequestRefused(
                    "no group of this scenario can be added to; give a group 'on_call: true', "
                    "and as its 'count' how many can come"
                )
            agents = simulation.add(request.group, request.count, request.start)
            return f"{len(agents)} of {request.group} come as soon as there is room"
        case Move():
            simulation.move(request.name, by=request.by)
            return f"{request.name} is moved"
        case DrawWall():
            request.require_length()
            name = _free_name(simulation)
            wall = {"points": request.points, "thickness": _WALL_THICKNESS}
            simulation.insert({"name": name, "wall": wall, "top": _WALL_TOP})
            return f"{name} is built"
        case RemoveObstacle():
            simulation.remove_obstacle(request.name)
            return f"{request.name} is removed"
        case SetDoor():
            if request.open:
                simulation.open_door(request.name)
            else:
                simulation.close_door(request.name)
            return f"{request.name} is {'opened' if request.open else 'closed'}"
    raise RequestRefused("that is no command")


def _free_name(simulation: Simulation) -> str:
    """Return a name for a drawn wall that no obstacle has or has had: events and commands refer to it by its name."""
    taken = {movable.name for movable, _ in simulation.movables()}
    taken |= {obstacle.name for obstacle in simulation.scenario.obstacles}
    taken |= {command.subject for command in simulation.commands if command.changes_place}
    return next(name for name in (f"{_WALL_NAME} {number}" for number in range(1, len(taken) + 2)) if name not in taken)


def _characters(agents: tuple[int, ...]) -> str:
    """Return the words for one or more agents, to which a verb in the singular fits."""
    return f"agent {agents[0]}" if len(agents) == 1 else f"each of {len(agents)} agents"


def _point(point: tuple[float, float]) -> str:
    """Return the words for a point, in whole centimeters."""
    return f"{point[0]:.2f}, {point[1]:.2f} m"
