"""Bodies and rooms of the planning tests."""

from pathlib import Path

import numpy as np
import pytest

from crowdsim.behaviors.behavior import Behavior


def make_behavior(
    name: str, torso: float, cost: float, facings: tuple[float, ...] = (0.0,), legs: float = 0.17
) -> Behavior:
    return Behavior(
        name=name,
        description="",
        facings=facings,
        detectors=("walking",),
        cost_per_meter=cost,
        speed=1.0,
        color="#000000",
        radii=np.array([legs, torso]),
        folder=Path(),
    )


@pytest.fixture(scope="session")
def behaviors() -> tuple[Behavior, ...]:
    """Side-stepping, arms held, walking, with the radii of the default set."""
    return (
        make_behavior("lateral", 0.17, 3.0, (-np.pi / 2.0, np.pi / 2.0)),
        make_behavior("arm_constrained", 0.26, 1.1),
        make_behavior("frontal", 0.32, 1.0),
    )
