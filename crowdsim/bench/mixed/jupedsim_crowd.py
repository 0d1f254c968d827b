"""JuPedSim's anticipation velocity model (an optional package) with the same starts and goals."""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np
from numpy.typing import NDArray
from shapely import Polygon

from crowdsim.bench.crowds.drills import State
from crowdsim.errors import CrowdSimError

RADIUS = 0.2
"""Default radius of its agents [m]; starts must be twice as far apart."""

STEP = 0.01
"""Its default time step [s]."""


def require_jupedsim() -> Any:
    """Return the package.

    Raises
    ------
    CrowdSimError
        If it is not installed.
    """
    try:
        return importlib.import_module("jupedsim")
    except ImportError as error:
        raise CrowdSimError(
            "this benchmark walks the same crowds with JuPedSim, which is not installed; "
            "pip install 'crowdsim[jupedsim]'"
        ) from error


def walk_anticipating(
    state: State, area: Polygon, goals: tuple[Polygon, ...], seconds: float, seed: int = 1
) -> NDArray[np.float64]:
    """Return when each agent of ``state`` reaches its goal region [s], nan if not by ``seconds``.

    Agents walk at their own speeds; everything else is the model's default. They head for the middle of a region.
    """
    jupedsim = require_jupedsim()
    model = jupedsim.AnticipationVelocityModel(rng_seed=seed)
    simulation = jupedsim.Simulation(model=model, geometry=area, dt=STEP)
    stages = [simulation.add_exit_stage(goal) for goal in goals]
    journeys = [simulation.add_journey(jupedsim.JourneyDescription([stage])) for stage in stages]
    names = {}
    for number, row in enumerate(state):
        goal = int(row["goal"])
        parameters = jupedsim.AnticipationVelocityModelAgentParameters(
            position=(float(row["x"]), float(row["y"])),
            desired_speed=float(row["speed"]),
            radius=RADIUS,
            journey_id=journeys[goal],
            stage_id=stages[goal],
        )
        names[simulation.add_agent(parameters)] = number
    arrived = np.full(len(state), np.nan)
    while simulation.agent_count() and simulation.elapsed_time() < seconds:
        simulation.iterate()
        for name in simulation.removed_agents():
            arrived[names[name]] = simulation.elapsed_time()
    return arrived
