"""Every error that crowdsim raises on purpose, in one tree.

A caller who wants to survive bad input catches :class:`CrowdSimError`; everything else is a bug. The
command line prints these without a traceback and leaves with :attr:`CrowdSimError.exit_code`.
"""


class CrowdSimError(Exception):
    """Base of all errors with a remedy the user can apply."""

    exit_code = 2


class ScenarioError(CrowdSimError):
    """A scenario file is wrong; the message lists every problem of the file, one a line."""


class GeometryError(CrowdSimError):
    """A polygon, solid or layer cannot be used as given."""


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
