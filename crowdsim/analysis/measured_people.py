"""Measurements of people to compare runs with; every table names its source."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

ONE_WAY_SPEEDS = (
    (0.25, 1.155, 1.624),
    (0.5, 1.168, 1.594),
    (0.75, 1.080, 1.575),
    (1.0, 0.938, 1.469),
    (1.5, 0.844, 1.298),
    (1.75, 0.509, 1.125),
    (2.0, 0.486, 1.019),
    (2.25, 0.412, 0.903),
    (2.5, 0.347, 0.675),
    (2.75, 0.315, 0.585),
    (3.0, 0.291, 0.490),
    (3.25, 0.287, 0.463),
)
"""Density [1/m2], and the 5 and 95 % quantiles of speeds [m/s] in unidirectional corridor flow."""

ONE_WAY_SOURCE = "HERMES experiments (Zhang et al. 2011), runs uo-*, classic method of PedPy 1.5.1"

WEIDMANN_SOURCE = "Weidmann 1993"
WEIDMANN_SPEED, WEIDMANN_SHAPE, WEIDMANN_DENSITY = 1.34, 1.913, 5.4
"""Free speed [m/s], shape [1/m2], and density at which nobody moves [1/m2]."""


def weidmann_speed(density: ArrayLike) -> Floats:
    """Return the speed [m/s] at densities [1/m2] after Weidmann; nan at a density of 0, 0 at 5.4 /m2 and above."""
    at = np.asarray(density, np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        speed = WEIDMANN_SPEED * (1.0 - np.exp(-WEIDMANN_SHAPE * (1.0 / at - 1.0 / WEIDMANN_DENSITY)))
    return np.where(at > 0.0, np.maximum(speed, 0.0), np.nan)


class FlowBand(NamedTuple):
    """Flows through bottlenecks whose width is from ``narrowest`` to below ``widest`` [m].

    ``studied`` is the number of these bottlenecks; ``least``, ``median`` and ``most`` are of their flows for each meter
    of width [1/(m s)].
    """

    narrowest: float
    widest: float
    studied: int
    least: float
    median: float
    most: float


FLOW_BANDS = (
    FlowBand(0.4, 0.65, 10, 1.87, 2.17, 2.47),
    FlowBand(0.65, 0.85, 9, 1.61, 1.79, 3.28),
    FlowBand(0.85, 1.05, 21, 1.7, 1.93, 2.77),
    FlowBand(1.05, 1.3, 14, 1.69, 1.99, 2.38),
    FlowBand(1.3, 1.7, 13, 1.78, 2.17, 2.38),
    FlowBand(1.7, 2.3, 6, 1.77, 1.93, 2.12),
    FlowBand(2.3, 5.1, 17, 2.05, 2.24, 2.42),
)
"""Measured flows through bottlenecks, by width."""

FLOW_SOURCE = (
    "90 bottlenecks: Mueller 1981, Nagai et al. 2006, Kretz et al. 2006, Seyfried et al. 2009, Daamen and Hoogendoorn "
    "2010, EG 2006, AO 2009, HERMES, Wuppertal 2018, pupils 2014"
)


def flow_band(width: float) -> FlowBand | None:
    """Return the measured flows through bottlenecks of a width [m]; None outside of 0.4 to 5.1 m."""
    return next((band for band in FLOW_BANDS if band.narrowest <= width < band.widest), None)


class ServiceTable(NamedTuple):
    """Levels of service A to F: ``least_areas`` is the least floor area of A to E [m2 a person]; F has less."""

    name: str
    least_areas: tuple[float, float, float, float, float]


_SQUARE_FOOT = 0.09290304

WALKWAYS = ServiceTable("Fruin 1971, walkways", (35 * _SQUARE_FOOT, 25 * _SQUARE_FOOT, 15 * _SQUARE_FOOT,
                                                10 * _SQUARE_FOOT, 5 * _SQUARE_FOOT))  # fmt: skip
QUEUES = ServiceTable("Fruin 1971, queues", (13 * _SQUARE_FOOT, 10 * _SQUARE_FOOT, 7 * _SQUARE_FOOT, 3 * _SQUARE_FOOT,
                                            2 * _SQUARE_FOOT))  # fmt: skip

HALL_ZONES = (("intimate", 0.0, 0.45), ("personal", 0.45, 1.2), ("social", 1.2, 3.6), ("public", 3.6, np.inf))
"""Zones of distance between two people, after Hall: name, from which distance, and below which [m]."""

HALL_SOURCE = "Hall 1966"
