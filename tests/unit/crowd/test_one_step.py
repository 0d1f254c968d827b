"""Steps are taken one after the other: a step within a step or beside one is refused, and what is no scenario, too."""

import threading
from pathlib import Path

import pytest

from crowdsim import CrowdSimError, Simulation, load_behaviors, load_scenario


@pytest.fixture(scope="module")
def scenario():
    return load_scenario("doorway", ["agents.0.count=1", "duration=30"])


@pytest.fixture(scope="module")
def motion(scenario):
    return load_behaviors(scenario)


@pytest.mark.parametrize("called", ["until", "progress"])
def test_what_run_calls_takes_no_steps(scenario, motion, tmp_path, called):
    file = tmp_path / "run.h5"
    calls = {"until": lambda simulation: simulation.step(), "progress": lambda *given: given[2].step()}
    simulation = Simulation(scenario, behavior_set=motion)
    with pytest.raises(CrowdSimError, match="a step is being taken, by run"):
        simulation.run(file, **{called: calls[called]})
    assert not list(tmp_path.iterdir())


def test_a_run_within_a_run_is_refused(scenario, motion):
    with pytest.raises(CrowdSimError, match="a step is being taken, by run"):
        Simulation(scenario, behavior_set=motion).run(None, until=lambda simulation: simulation.run(None))


def test_a_run_that_is_closed_ends_with_an_error_that_says_so(scenario, motion, tmp_path):
    with pytest.raises(CrowdSimError, match="was run or closed"):
        Simulation(scenario, behavior_set=motion).run(tmp_path / "run.h5", until=lambda simulation: simulation.close())
    assert not list(tmp_path.iterdir())


def test_a_second_thread_is_refused_and_harms_nothing(scenario, motion):
    wanted = Simulation(scenario, behavior_set=motion)
    wanted.run(None)
    refused = []

    def beside(simulation):
        try:
            simulation.step()
        except CrowdSimError as error:
            refused.append(str(error))

    def until(simulation):
        thread = threading.Thread(target=beside, args=(simulation,))
        thread.start()
        thread.join()
        return simulation.finished

    simulation = Simulation(scenario, behavior_set=motion)
    simulation.run(None, until=until)
    assert len(refused) == simulation.step_count + 1
    assert "in another thread" in refused[0]
    assert simulation.state_hash == wanted.state_hash


def test_a_step_that_fails_does_not_bar_the_next(scenario, motion):
    with Simulation(scenario, behavior_set=motion) as simulation:
        simulation.step()
        with pytest.raises(CrowdSimError, match="the recording would lack"):
            simulation.run("never.h5")
        simulation.step()
        assert simulation.step_count == 2


@pytest.mark.parametrize("given", ["corridor", Path("corridor.yaml"), None, {}, 3])
def test_what_is_no_scenario_is_refused_with_what_makes_one(given):
    for take in (Simulation, load_behaviors):
        with pytest.raises(CrowdSimError, match=r"expected a Scenario, got .*load_scenario"):
            take(given)


@pytest.mark.parametrize("workers", [0, -1, 1.5, "2", True, None])
def test_what_is_no_number_of_threads_is_refused(workers):
    with pytest.raises(CrowdSimError, match="give a whole number of threads, 1 or more"):
        Simulation(load_scenario("doorway"), workers=workers)
