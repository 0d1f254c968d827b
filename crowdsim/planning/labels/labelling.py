"""Sections of a path from the intervals where behaviors do not fit (2018 paper, algorithm 2)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from crowdsim.planning.labels.annotated_path import Section
from crowdsim.planning.labels.labelling_kernels import TERMS, label_stretches

Intervals = NDArray[np.float64]

_NOWHERE = np.empty((0, 2))


def label_path(
    blocked: Sequence[Intervals],
    costs: NDArray[np.float64],
    turned: NDArray[np.bool_],
    length: float,
    terms: NDArray[np.float64] = TERMS,
) -> tuple[tuple[Section, ...], float]:
    """Find the cheapest sections over a path, and their cost.

    A stretch that requires a narrower behavior is lengthened to the least section of ``terms`` if it is shorter, as a
    narrower behavior always fits. A stretch shorter than this that would allow a wider behavior keeps the narrower one.
    Turned sections border on the preferred behavior, with room to turn, or on the ends of the path, where an agent may
    stand at any heading.

    Parameters
    ----------
    blocked: blocked[i] (k, 2), arc-length intervals in which behavior i does not fit [m]. Where a behavior does not
    fit, no wider one does.
    costs: (n,) cost per meter.
    turned: (n,) True if the body faces away from its direction of motion.
    length: length of the path [m].
    terms: (4,) as :data:`~crowdsim.planning.labels.labelling_kernels.TERMS`.

    Returns
    -------
    (sections, cost); ((), inf) if some place fits no behavior.
    """
    ends = np.cumsum([len(intervals) for intervals in blocked])
    stretches = np.concatenate(blocked) if ends[-1] else _NOWHERE
    found, cost = label_stretches(stretches, ends, costs, turned, terms, length)
    return tuple(Section(int(label), start, end) for label, start, end in found.tolist()), cost
