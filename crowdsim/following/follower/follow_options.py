"""Requirements and limits of a search along a path."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crowdsim.constants import TRACKING_MARGIN

THOROUGH_BRANCHES = 200
"""Branches laid at each stage of the second search, if the quick one found nothing."""

BRIEFLY = 1
"""Nodes in a row without progress in a first search: searches that may stand longer turn to and fro on the spot where a
search that may not finds a motion that goes on."""

SLOW = 1.5
"""Time that a motion takes beyond that of its path as planned [s] from which on a quicker one is looked for."""

QUICKER = 0.95
"""Share of the time of a motion below which another one counts as quicker."""

QUICKEN_BUDGET = 100
"""Map queries of a search for a quicker motion."""


@dataclass(frozen=True)
class FollowOptions:
    """Requirements and limits of a search along a path.

    Attributes
    ----------
    goal_tolerance : float
        Largest distance from the path's end [m] at which the last node passes it; at which the node ends, if it must
        end standing or with a heading.
    end_standing : bool
        True if the last node must end standing.
    goal_heading : float or None
        Heading of the body at the end of the last node [rad]; None for any.
    goal_heading_tolerance : float
        Largest difference from ``goal_heading`` [rad].
    margin : float
        Clearance beyond the body's radius for nodes of a wider behavior than planned [m]: the margin of plans.
    transition_reach : float
        A turned behavior may be used only within this distance of a section that is planned for it or for a narrower
        behavior [m].
    heading_tolerance : float
        Largest angle between the body's heading and one that its behavior allows on the path, at the end of each node
        that moves [rad].
    deviation : float
        Largest distance of the end of a node from the path [m].
    sampling_margin : float
        Clearance beyond the body's radius that covers the motion between two samples of the test [m].
    candidates : int
        Branches kept at each stage besides the single successors.
    branches : int
        Branches laid on the path at each stage besides the single successors, the most promising first. If a search
        with so many finds nothing, it is repeated with THOROUGH_BRANCHES. More: slower, a little more often successful.
    budget : int
        Map queries before the search gives up. If it finds a slow motion, a search for a quicker one makes up to
        QUICKEN_BUDGET more.
    most_still : int
        Largest number of nodes in a row that turn or shift in place before the search goes on along the path. A search
        with BRIEFLY of them comes first.

    Examples
    --------
    >>> FollowOptions(end_standing=True, goal_heading=0.0).goal_tolerance
    0.35
    """

    goal_tolerance: float = 0.35
    end_standing: bool = False
    goal_heading: float | None = None
    goal_heading_tolerance: float = float(np.radians(15.0))
    margin: float = TRACKING_MARGIN
    transition_reach: float = 2.0
    heading_tolerance: float = float(np.radians(35.0))
    deviation: float = 0.6
    sampling_margin: float = 0.005
    candidates: int = 48
    branches: int = 24
    budget: int = 4_000
    most_still: int = 6
