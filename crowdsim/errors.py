"""The tree of errors and warnings that crowdsim raises on purpose.

Catch :class:`CrowdSimError` to handle bad input; any other exception is a bug. The command line prints these errors
without a traceback and exits with :attr:`CrowdSimError.exit_code`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass


class CrowdSimError(Exception):
    """Base of all errors that the user can remedy."""

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
    """

    def __init__(self, problems: Iterable[Problem] | str) -> None:
        self.problems: list[Problem] = [] if isinstance(problems, str) else list(problems)
        super().__init__(problems if isinstance(problems, str) else "\n".join(map(str, self.problems)))


class GeometryError(CrowdSimError):
    """A polygon, solid or layer is invalid."""


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
    """A cached file is damaged; it is made anew."""


class PathNotFound(CrowdSimError):
    """No path with the required clearance connects start and goal."""


class MotionError(CrowdSimError):
    """A capture, a motion set or a motion graph is unusable."""


class BehaviorError(CrowdSimError):
    """A behavior folder is incomplete or contradicts itself."""


class RecordingError(CrowdSimError):
    """A recording file is missing, unfinished, or of another format or version."""


class ColumnError(CrowdSimError):
    """A column of an own system is unknown, not declared, read-only, or of another dtype or shape."""


class StageError(CrowdSimError):
    """An own system stands before a stage that does not exist, or does what is not for systems."""


class SystemFailed(CrowdSimError):
    """An own system raised an error, which is its ``__cause__``; the simulation takes no more steps."""


class RanksError(CrowdSimError):
    """A scenario cannot run on several processes; the message names what is in the way, and what to do."""


class DrawingUnavailable(CrowdSimError):
    """No drawing backend works on this machine: no display, no EGL, no OSMesa."""

    exit_code = 3
