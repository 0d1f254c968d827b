"""The tree of errors and warnings that crowdsim raises on purpose.

Catch :class:`CrowdSimError` to handle bad input; any other exception is a bug. The command line prints these errors
without a traceback and exits with :attr:`CrowdSimError.exit_code`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass


class CrowdSimError(Exception):
    """Base of all errors that the user can remedy.

    Examples
    --------
    >>> try:
    ...     Recording.open("absent.h5")
    ... except CrowdSimError as error:
    ...     print(error)
    there is no recording absent.h5; write one with 'crowdsim run SCENARIO -o absent.h5'
    """

    exit_code = 2


@dataclass(frozen=True)
class Problem:
    """A mistake in a scenario file: its position, and what to do about it.

    Attributes
    ----------
    file : str
        Name of the file, or another origin such as ``--set agents.0.count``.
    line, column : int or None
        Position in the file, counted from 1; None if the origin is not a text file.
    key : str
        Dotted path of the entry, ``agents.0.count``; empty for the file as a whole.
    message : str
        What is wrong, and the remedy.
    """

    file: str
    line: int | None
    column: int | None
    key: str
    message: str

    def __str__(self) -> str:
        """Return ``file:line:column: key: message``, or ``origin: key: message`` without a position."""
        if self.line is None:
            # An origin such as ``--set agents.0.count`` ends with the key already.
            key = "" if self.file.endswith(f" {self.key}") else self.key
            return ": ".join(part for part in (self.file, key, self.message) if part)
        return ": ".join(part for part in (f"{self.file}:{self.line}:{self.column}", self.key, self.message) if part)


class ScenarioError(CrowdSimError):
    """A scenario is invalid; the message lists all problems of the file, one per line.

    Attributes
    ----------
    problems : list of Problem
        The same problems with their positions; empty if the error was raised with a plain message.

    Examples
    --------
    >>> try:
    ...     load_scenario("doorway", ["duration=0", "agents.0.cuont=3"])
    ... except ScenarioError as error:
    ...     for problem in error.problems:
    ...         print(problem)
    --set duration: must be greater than 0.0, got 0
    --set agents.0.cuont: unknown key; did you mean 'count'?
    """

    def __init__(self, problems: Iterable[Problem] | str) -> None:
        self.problems: list[Problem] = [] if isinstance(problems, str) else list(problems)
        super().__init__(problems if isinstance(problems, str) else "\n".join(map(str, self.problems)))


class GeometryError(CrowdSimError):
    """A polygon, solid or layer is invalid, or an argument of a mesh or a path."""


class PlaceError(CrowdSimError):
    """A file with an environment (mesh, floor plan) is unusable; the message names the file and the remedy."""


class StaleHandle(CrowdSimError):
    """A handle refers to an obstacle that was removed from the mesh, or was never in it."""


class GeometryWarning(UserWarning):
    """A polygon is used as given but looks like a mistake, for example because it is not in meters."""


class BoundExceeded(CrowdSimError):
    """A loop went on beyond what any sound mesh or search needs: a mistake of crowdsim, stopped before it hangs."""

    def __init__(self) -> None:
        super().__init__(
            "a search or a walk over the navigation mesh did not end within its bound; this is a mistake in crowdsim: "
            "report it with the scenario, and move what was last put into the place by a centimeter to go on"
        )


class CacheWarning(UserWarning):
    """A cached file is damaged and made anew, or cannot be stored."""


class PathNotFound(CrowdSimError):
    """No path with the required clearance connects start and goal.

    Examples
    --------
    >>> try:
    ...     NavMesh(shapely.box(0, 0, 8, 1)).find_path((1, 0.5), (7, 0.5), radius=0.6)
    ... except PathNotFound as error:
    ...     print(error)
    start blocked: (1, 0.5) is 0.5 m from the nearest obstacle; the path needs 0.6 m
    """


class MotionError(CrowdSimError):
    """A capture, a motion set or a motion graph is unusable, or an argument of a search for motion."""


class BehaviorError(CrowdSimError):
    """A behavior folder is incomplete or contradicts itself, or behaviors do not fit the layers or the planner."""


class RecordingError(CrowdSimError):
    """A recording file is missing, unfinished, of another format or version, or cannot be written."""


class ColumnError(CrowdSimError):
    """A column of an own system is unknown, not declared, read-only, or of another dtype or shape.

    Examples
    --------
    >>> try:
    ...     Simulation(load_scenario("doorway")).agents.x = 0.0
    ... except ColumnError as error:
    ...     print(error)
    agents are only read, so 'x' cannot be set; send agents elsewhere with simulation.set_goal(agents, goal)
    """


class StageError(CrowdSimError):
    """An own system cannot be added (its name, its stage or its ``run`` is wrong), or takes steps itself.

    Examples
    --------
    >>> class Idle:
    ...     reads = writes = ()
    ...     def run(self, columns, simulation): ...
    >>> try:
    ...     Simulation(load_scenario("doorway")).add_system(Idle(), before="moves")
    ... except StageError as error:
    ...     print(error)
    there is no stage or system 'moves'; did you mean 'move'?
    """


class SystemFailed(CrowdSimError):
    """An own system raised an error, which is its ``__cause__``; the simulation takes no more steps.

    Examples
    --------
    >>> class Broken:
    ...     reads = writes = ()
    ...     def run(self, columns, simulation):
    ...         raise ValueError("no such file")
    >>> with Simulation(load_scenario("doorway")) as simulation:
    ...     simulation.add_system(Broken(), before="move")
    ...     try:
    ...         simulation.step()
    ...     except SystemFailed as error:
    ...         print(error)
    system 'Broken' failed in step 0: ValueError: no such file
    """


class RanksError(CrowdSimError):
    """A scenario cannot run on several processes; the message names what is in the way, and what to do."""


class DrawingUnavailable(CrowdSimError):
    """No drawing backend works on this machine: no display, no EGL, no OSMesa."""

    exit_code = 3


def one_line(error: Exception) -> str:
    """Return the message of an error, such as a parser's, on one line, cut off after 120 signs."""
    return " ".join(str(error).split())[:120]
