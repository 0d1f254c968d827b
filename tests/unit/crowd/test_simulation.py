"""A simulation is run once, from its start, and ends its threads."""

import threading
from pathlib import Path

import numpy as np
import pytest

from crowdsim.crowd.captured_crowd import CapturedCrowd
from crowdsim.crowd.simulation import Simulation
from crowdsim.errors import CrowdSimError
from crowdsim.scenario.loader import parse_scenario
from tests.support.two_rooms import two_rooms

ONE = "name: one, count: 1, start: {point: [6, 3]}, goal: {point: [9, 3]}"


def worker_threads() -> list[str]:
    return [thread.name for thread in threading.enumerate() if thread.name.startswith("crowdsim")]


def test_a_run_ends_the_threads_and_is_not_repeated(tmp_path: Path) -> None:
    simulation = Simulation(parse_scenario(two_rooms(ONE)))
    with simulation.run(tmp_path / "run.h5") as recording:
        content, steps = (tmp_path / "run.h5").read_bytes(), recording.steps
    assert worker_threads() == []
    for again in (simulation.step, lambda: simulation.run(tmp_path / "run.h5")):
        with pytest.raises(CrowdSimError, match="was run or closed; make a new Simulation"):
            again()
    assert (tmp_path / "run.h5").read_bytes() == content
    assert simulation.step_count == steps
    assert simulation.arrived == 1


@pytest.mark.parametrize("locomotion", ["captured", "auto"])
def test_nothing_is_kept_of_those_who_left(locomotion: str) -> None:
    group = (
        f"name: some, locomotion: {locomotion}, count: 3, start: {{rectangle: [6, 2, 7, 4]}}, goal: {{point: [9, 3]}}"
    )
    with Simulation(parse_scenario(two_rooms(group))) as simulation:
        while not simulation.finished:
            simulation.step()
        assert simulation.arrived == 3
        crowd = simulation.crowd
        captured = crowd if isinstance(crowd, CapturedCrowd) else crowd.captured
        plans, spawning = captured.plans, captured.spawning
        assert (spawning.requested, spawning.refused, plans.looked_ahead, crowd.new_routes()) == ({}, {}, {}, [])
        assert (dict(plans.motions), plans.routes, plans.unreachable, plans.away) == ({}, {}, {}, set())
        assert not any(plans.searches.is_under_way(agent) for agent in range(3))
        assert (plans.motions.table.nodes == -1).all()
        assert np.isnan(crowd.frame().x).all()


def test_an_agent_that_arrived_and_finds_no_way_back_counts_once() -> None:
    group = "name: some, locomotion: captured, count: 2, start: {rectangle: [6, 2, 7, 4]}, goal: {point: [9, 3]}"
    with Simulation(parse_scenario(two_rooms(group))) as simulation:
        crowd = simulation.crowd
        assert isinstance(crowd, CapturedCrowd)
        # The first one has arrived, gave way, and finds no way back; the second one is on its way.
        crowd.despawning.arrived[0] = 1
        crowd.plans.unreachable[0] = "no path"
        assert not simulation.finished
        # Nor does the second one find a way.
        crowd.plans.unreachable[1] = "no path"
        assert simulation.finished


def test_a_block_ends_the_threads_of_a_simulation_that_was_stepped(tmp_path: Path) -> None:
    with Simulation(parse_scenario(two_rooms(ONE))) as simulation:
        simulation.step()
        assert worker_threads()
        with pytest.raises(CrowdSimError, match="has taken 1 steps"):
            simulation.run(tmp_path / "run.h5")
    assert worker_threads() == []
    assert list(tmp_path.iterdir()) == []
    simulation.close()
    with pytest.raises(CrowdSimError, match="was run or closed"):
        simulation.step()
