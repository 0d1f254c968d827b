"""Every error that crowdsim raises on purpose, in one tree.

A caller who wants to survive bad input catches :class:`CrowdSimError`; everything else is a bug. The
command line prints these without a traceback and leaves with :attr:`CrowdSimError.exit_code`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass


class CrowdSimError(Exception):
    """Base of all errors with a remedy the user can apply."""

    exit_code = 2


@dataclass(frozen=True)
class Problem:
    """One thing wrong with a scenario: where it stands and what to do about it.

    ``line`` and ``column`` count from 1 and are None where ``file`` is no text, as with an override of the command
    line. ``key`` is the dotted path of the entry, empty for the file as a whole.
    """

    file: str
    line: int | None
    column: int | None
    key: str
    message: str

    def __str__(self) -> str:
        if self.line is None:
            key = "" if self.file.endswith(f" {self.key}") else self.key
            return ": ".join(part for part in (self.file, key, self.message) if part)
        return ": ".join(part for part in (f"{self.file}:{self.line}:{self.column}", self.key, self.message) if part)


class ScenarioError(CrowdSimError):
    """A scenario is wrong; the message lists every problem of the file, one a line.

    Attributes
    ----------
    problems : list of Problem
        The same with their positions; empty where a plain message was given.
    """

    def __init__(self, problems: Iterable[Problem] | str) -> None:
        self.problems: list[Problem] = [] if isinstance(problems, str) else list(problems)
        super().__init__(problems if isinstance(problems, str) else "\n".join(map(str, self.problems)))


class GeometryError(CrowdSimError):
    """A polygon, solid or layer cannot be used as given."""


class PlaceError(CrowdSimError):
    """A file of a place, or the scene in it, cannot be used as it is; the message names the file and what to do."""


class StaleHandle(CrowdSimError):
    """A handle of an obstacle that is not in the mesh, or no longer."""


class GeometryWarning(UserWarning):
    """A polygon is used as given but looks like a mistake, such as one not drawn in meters."""


class CacheWarning(UserWarning):
    """Something that was kept from an earlier run is damaged, and made anew."""


class PathNotFound(CrowdSimError):
    """No path of the wanted clearance joins start and goal."""


class MotionError(CrowdSimError):
    """A capture, a motion set or a motion graph cannot be used as given."""


class BehaviorError(CrowdSimError):
    """A behavior folder is incomplete or contradicts itself."""


class RecordingError(CrowdSimError):
    """A recording file is missing, unfinished, or of another format or version."""


class DrawingUnavailable(CrowdSimError):
    """Nothing on this machine can draw: no display, no EGL, no OSMesa."""

    exit_code = 3
