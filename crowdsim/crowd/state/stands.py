"""How well characters stand where they are to."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def stands_summary(off: NDArray[np.float64], turned: NDArray[np.float64]) -> dict[str, float | int | None]:
    """How many stood at a place, and how far off it [m] and the heading asked for [rad, nan for any] they were."""
    turned = np.degrees(turned[~np.isnan(turned)])
    return {
        "stood": len(off),
        "off_goal_p95": float(np.quantile(off, 0.95)) if len(off) else None,
        "off_goal_most": float(off.max()) if len(off) else None,
        "off_heading_most": float(turned.max()) if len(turned) else None,
    }
