"""What criteria need is read from recordings step by step."""

from types import SimpleNamespace

import numpy as np
import pytest

from crowdsim.recording.header import AgentState
from crowdsim.recording.measured import Crossings, Measured
from crowdsim.scenario.loader import parse_scenario
from crowdsim.validate.observed import observe

TEXT = """
crowdsim: 1
name: room
seed: 1
duration: 10
floor: {{rectangle: [0, 0, 200, 4]}}
agents:
  - {{name: a, locomotion: {}, count: 20, start: {{rectangle: [1, 0, 21, 4]}}, goal: {{rectangle: [190, 1, 199, 3]}}}}
"""


@pytest.mark.parametrize(("locomotion", "rate"), [("steered", 10), ("captured", 30)])
def test_a_crossing_at_a_step_has_the_place_of_that_step(locomotion: str, rate: int) -> None:
    scenario = parse_scenario(TEXT.format(locomotion))
    assert scenario.steps_per_second == rate
    count, agents = 20, np.arange(20)
    # Agent k crosses exactly at step 7 k; in each step, x is the number of the step [m].
    crossings = Crossings(2.0, 2.0, agents.astype(np.int32), 7 * agents / rate, np.ones(count, np.bool_))
    steps = np.arange(7 * count)
    recording = SimpleNamespace(
        summary={},
        measured=Measured(lines={"line": crossings}),
        steps=len(steps),
        x=np.repeat(steps[:, None].astype(np.float64), count, axis=1),
        y=np.ones((len(steps), count)),
        state=np.full((len(steps), count), AgentState.MOVING),
    )
    seen = observe(scenario, recording, 1.0)  # type: ignore[arg-type]
    np.testing.assert_array_equal(seen.crossed["line"][:, 0], 7 * agents)
