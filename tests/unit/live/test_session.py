"""Sessions of live simulations: what is asked is done, told and recorded, and can be run again."""

import numpy as np
import pytest

from crowdsim import Recording, Simulation, load_scenario
from crowdsim.live.pictures import picture, picture_columns
from crowdsim.live.requests import RequestRefused, read_request
from crowdsim.live.session import Session
from crowdsim.recording.header import AgentState
from crowdsim.scenario.loader import parse_scenario
from tests.support.live import Told, living, read_picture

HALL = """
crowdsim: 1
name: hall
seed: 3
duration: {duration}
floor: {{rectangle: [0, 0, 12, 8]}}
obstacles:
  - {{name: cart, box: {{center: [6, 1.5], size: [0.8, 0.6]}}, top: 0.9, movable: true}}
  - {{name: pillar, box: {{center: [6, 7], size: [0.5, 0.5]}}, top: 2.5}}
doors: [{{name: gate, box: {{min: [8.9, 0], max: [9.1, 2.5]}}, top: 2.1}}]
agents:
  - {{name: walkers, count: 3, interval: 0.5, locomotion: {locomotion}, start: {{rectangle: [0.5, 3, 2, 6]}},
      goals: [{{point: [11, 4]}}, {{point: [1, 4]}}], repeat: {rounds}}}
  - {{name: guests, count: 4, on_call: true, locomotion: {locomotion}, start: {{rectangle: [0.5, 0.5, 2, 2]}},
      goal: {{point: [11, 6]}}}}
"""


def hall(locomotion="captured", duration=60, rounds=9):
    return parse_scenario(HALL.format(locomotion=locomotion, duration=duration, rounds=rounds))


def frames_of(live):
    columns = picture_columns(live.simulation.header.motion)
    return [read_picture(content, columns) for content in list(live.told.pictures)]


@pytest.mark.parametrize("locomotion", ["captured", "steered", "auto"])
def test_a_session_can_be_run_again_to_the_same_states(locomotion, tmp_path):
    file = tmp_path / "run.h5"
    with living(hall(locomotion), file, speed=8.0) as live:
        live.wait(lambda: live.simulation.step_count > 12)
        live.ask(do="set_goal", agents=[0], goal=[2, 7], on_arrival="stay")
        live.ask(do="move", name="cart", by=[0.5, 0.0])
        live.ask(do="draw_wall", points=[[4, 0.2], [5, 0.2]])
        added = live.ask(do="add", group="guests", count=2)
        live.wait(lambda: live.simulation.step_count > added["step"] + 6)
        live.ask(do="add", group="guests", count=1, start=[10, 1])
        live.ask(do="set_door", name="gate", open=False)
        live.ask(do="pause", paused=True)
        live.ask(do="remove_agents", agents=[1])
        live.ask(do="pause", paused=False)
        live.ask(do="remove_obstacle", name="drawn wall 1")
        step = live.simulation.step_count
        live.wait(lambda: live.simulation.step_count > step + 20)
    live.simulation.save_scenario(tmp_path / "run.yaml")
    with Recording.open(file) as recording, Simulation(load_scenario(tmp_path / "run.yaml"), workers=1) as again:
        assert recording.steps == live.simulation.step_count
        for wanted in recording.state_hash[:]:
            again.step()
            assert again.state_hash == wanted
        # What was drawn is in the recording, too.
        assert [movable.name for movable in recording.header.movables] == ["cart", "gate", "drawn wall 1"]
        drawn = [change for change in recording.changes if change.movable == 2]
        assert [change.footprint is None for change in drawn] == [False, True]


def test_pictures_hold_what_recordings_hold(tmp_path):
    with living(hall("auto"), tmp_path / "run.h5", speed=8.0) as live:
        live.wait(lambda: live.simulation.step_count > 60)
    with Recording.open(tmp_path / "run.h5") as recording:
        frames = frames_of(live)
        # The first picture is of nobody, before the first step.
        assert len(frames[0][1]["agent"]) == 0
        assert [step for step, _ in frames[1:]] == list(range(recording.steps))
        for step, columns in frames[1:]:
            frame = recording.at_step(step)
            here = np.flatnonzero(frame.state != AgentState.ABSENT)
            assert columns["agent"].tolist() == here.tolist()
            for name in ("x", "y", "node", "previous", "frame", "phase", "behavior", "state"):
                wanted = getattr(frame, name)[here]
                if name == "frame":
                    wanted = np.where(np.isfinite(frame.phase[here]), columns["frame"], wanted)
                np.testing.assert_array_equal(columns[name], wanted, name)
            turned = columns["heading"] * (2 * np.pi / 65536) - frame.heading[here]
            assert np.abs(np.mod(turned + np.pi, 2 * np.pi) - np.pi).max(initial=0.0) < 1e-4


def test_pause_stops_and_a_step_is_one_step():
    with living(hall(), speed=8.0) as live:
        live.wait(lambda: live.simulation.step_count > 3)
        live.ask(do="pause", paused=True)
        stood = live.ask(do="set_speed", speed=4)["step"]
        assert live.ask(do="step")["words"] == "one step"
        live.wait(lambda: live.simulation.step_count == stood + 1)
        assert live.told.states[-1]["paused"] is True
        assert live.ask(do="set_speed", speed=8)["step"] == stood + 1
        live.ask(do="pause", paused=False)
        live.wait(lambda: live.simulation.step_count > stood + 5)
        assert live.told.states[-1] | {"on_call": {}} == {
            "kind": "state",
            "paused": False,
            "speed": 8.0,
            "over": "",
            "on_call": {},
        }


def test_what_nothing_waits_for_is_there_within_two_steps():
    with living(hall(), speed=2.0) as live:
        live.wait(lambda: live.simulation.step_count > 3)
        before, told = live.told.thing("cart")["outline"], len(live.told.all_things)
        asked = live.simulation.step_count
        live.ask(do="move", name="cart", by=[0.0, -0.5])
        live.wait(lambda: len(live.told.all_things) > told)
        pictures = [kind for kind in live.told.order[: live.told.order.index("things", 2) + 1] if kind == "picture"]
        assert len(pictures) - 1 <= asked + 2
        after = live.told.thing("cart")["outline"]
        assert np.allclose(np.array(after) - np.array(before), [0.0, -0.5])


@pytest.mark.parametrize(
    ("request_", "said"),
    [
        ({"do": "set_goal", "agents": [0], "goal": [60, 60]}, "floor"),
        ({"do": "set_goal", "agents": [99], "goal": [6, 4]}, "there is no agent 99"),
        ({"do": "move", "name": "pillar", "by": [1, 0]}, "never changes"),
        ({"do": "move", "name": "nothing", "by": [1, 0]}, "no obstacle 'nothing'"),
        ({"do": "set_door", "name": "gate", "open": True}, "open already"),
        ({"do": "add", "group": "walkers", "count": 1}, "on call"),
        ({"do": "add", "group": "guests", "count": 5}, "4 left"),
        ({"do": "draw_wall", "points": [[1, 1], [1, 1.05]]}, "a wall is"),
        ({"do": "remove_obstacle", "name": "gate"}, "is a door"),
    ],
    ids=lambda value: value["do"] if isinstance(value, dict) else None,
)
def test_what_is_impossible_is_refused_in_words(request_, said):
    with living(hall()) as live:
        with pytest.raises(RequestRefused, match=said):
            live.ask(**request_)
        step = live.simulation.step_count
        live.wait(lambda: live.simulation.step_count > step)


def test_without_groups_on_call_the_scenario_is_told_what_it_lacks():
    scenario = parse_scenario(HALL.format(locomotion="captured", duration=60, rounds=9).replace("on_call: true, ", ""))
    with living(scenario) as live, pytest.raises(RequestRefused, match="give a group 'on_call: true'"):
        live.ask(do="add", group="guests", count=1)


def test_when_all_have_arrived_it_stands_until_it_goes_on(tmp_path):
    with living(hall(rounds=1, duration=600), tmp_path / "run.h5", speed=8.0) as live:
        live.ask(do="remove_agents", agents=[0, 1, 2])
        live.wait(lambda: live.told.states and live.told.states[-1]["over"])
        assert "all have arrived" in live.told.states[-1]["over"]
        stood = live.simulation.step_count
        live.ask(do="add", group="guests", count=1)
        live.wait(lambda: live.simulation.step_count > stood + 10)
        assert live.told.states[-1]["over"] == ""
        live.ask(do="pause", paused=True)
        live.ask(do="remove_agents", agents=[3])
        live.ask(do="pause", paused=False)
        live.wait(lambda: live.told.states[-1]["over"])
    live.simulation.save_scenario(tmp_path / "run.yaml")
    with Simulation(load_scenario(tmp_path / "run.yaml")) as again:
        again.run(None)
        assert again.state_hash == live.simulation.state_hash


def test_a_scenario_that_is_over_takes_no_commands():
    with living(hall(duration=1.5), speed=8.0) as live:
        live.wait(lambda: live.told.states and live.told.states[-1]["over"])
        with pytest.raises(RequestRefused, match="longer 'duration'"):
            live.ask(do="set_goal", agents=[0], goal=[2, 7])


def test_what_waits_at_the_end_is_refused():
    with Simulation(hall()) as simulation:
        asked = []
        session = Session(simulation, Told(), lambda: len(asked) == 3)
        request = read_request('{"id": 1, "do": "set_goal", "agents": [0], "goal": [2, 7]}')
        gone = session.ask(request)
        assert gone.cancel()
        # All are asked before the first step, in which the session ends.
        asked += [session.ask(request), session.ask(request), session.ask(request)]
        session.step_until_stopped(None)
        asked.append(session.ask(request))
        for answer in asked:
            with pytest.raises(RequestRefused, match="has ended"):
                answer.result(timeout=10)


def test_who_has_gone_gets_no_answer_and_the_simulation_goes_on():
    with living(hall(), speed=8.0) as live:
        request = read_request('{"id": 1, "do": "set_goal", "agents": [0], "goal": [2, 7]}')
        live.wait(lambda: live.simulation.step_count > 12)
        live.ask(do="pause", paused=True)
        for _ in range(20):
            live.session.ask(request).cancel()
        step = live.simulation.step_count
        live.ask(do="pause", paused=False)
        live.wait(lambda: live.simulation.step_count > step + 5)
        assert len(live.simulation.commands) <= 20


def test_pictures_are_small():
    with Simulation(hall("captured")) as simulation:
        simulation.run(None, until=lambda simulation: simulation.time > 2.0)
        content = picture(0, simulation.crowd.frame(), picture_columns(simulation.header.motion))
        present = len(simulation.agents.present)
    assert present > 0
    assert len(content) <= 12 + 24 * present
