"""The anticipation velocity model of JuPedSim, which an extra installs, on the same starts and goals."""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np
from numpy.typing import NDArray
from shapely import Polygon

from crowdsim.bench.crowds.drills import State
from crowdsim.errors import CrowdSimError

RADIUS = 0.2
"""Of its agents, by default [m]; starts have to be twice as far apart."""

STEP = 0.01
"""Its own default [s]."""


def require_jupedsim() -> Any:
    """The package.

    Raises
    ------
    CrowdSimError
        Where it is not installed.
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
    """When each agent of ``state`` arrives in the region of its goal [s], nan for those who have not by ``seconds``.

    They walk as fast as told; all else is as the model has it by default. It heads for the middle of a region.
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
