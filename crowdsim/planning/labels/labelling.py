"""From the stretches where behaviors do not fit to the sections of an annotated path (2018 paper, algorithm 2)."""

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
    """Cheapest sections over a path of ``length`` meters, and their cost; ((), inf) where some place fits no behavior.

    blocked[i]: (k, 2) arc-length intervals where behavior i does not fit; what does not fit a narrower behavior fits no
    wider one. costs: (n,) a meter. turned: (n,) whether the body moves turned off its way. terms: as
    :data:`~crowdsim.planning.labels.labelling_kernels.TERMS`.

    A stretch shorter than ``MIN_SECTION`` that asks for a narrower behavior is lengthened, for narrower always fits;
    a shorter stretch that would allow a wider one is given to the narrower. Turned sections border on the
    preferred behavior with room to turn, or on the ends of the path, where a character may stand as it likes.
    """
    ends = np.cumsum([len(intervals) for intervals in blocked])
    stretches = np.concatenate(blocked) if ends[-1] else _NOWHERE
    found, cost = label_stretches(stretches, ends, costs, turned, terms, length)
    return tuple(Section(int(label), start, end) for label, start, end in found.tolist()), cost
