"""The speed that agents are given picks the captured gait that they walk in."""

from pathlib import Path

import numpy as np
import pytest

import crowdsim
from crowdsim.behaviors.gaits import gait_clips, natural_speed
from crowdsim.crowd.state.assets import load_behaviors
from crowdsim.motion.graph.assembly import clip_frames

LANE = """\
crowdsim: 1
name: gaits
seed: 3
duration: 60.0
floor: {{rectangle: [0.0, 0.0, 24.0, 4.0]}}
behaviors: [frontal]
motion: {{captures: {folder}, clips: ["16_*.bvh"]}}
agents:
  - name: walkers
    count: 2
    start: {{rectangle: [0.8, 1.0, 1.6, 3.0]}}
    goal: {{rectangle: [22.4, 1.0, 23.2, 3.0]}}
    interval: 6.0
    locomotion: {locomotion}
    speed: {speed}
"""
SLOW = {f"16_{number}" for number in range(11, 21)}
NORMAL = {"16_31", "16_33", "16_47", "16_58"}
BRISK = {f"16_{number}" for number in range(21, 31)}


@pytest.mark.parametrize("locomotion", ["captured", "steered"])
@pytest.mark.parametrize(("speed", "gait"), [(0.9, SLOW), (1.3, NORMAL), (1.7, BRISK)])
def test_agents_walk_in_the_nearest_gait(
    shared: Path, tmp_path: Path, locomotion: str, speed: float, gait: set[str]
) -> None:
    file = tmp_path / "gaits.yaml"
    file.write_text(LANE.format(folder=shared / "mocap", speed=speed, locomotion=locomotion))
    scenario = crowdsim.load_scenario(file)
    motion = load_behaviors(scenario)
    # Steered bodies are deformed from a walk of the gait, or one made of it; captured ones play no walk of another.
    (made,) = (note for note in motion.notes if note.startswith("made of a cycle of clip"))
    assert made.split("'")[1][:5] in gait
    assert gait_clips(motion)[0].name[:5] in gait | {"made_"}
    assert natural_speed(gait_clips(motion)[0]) == pytest.approx(speed, abs=0.15)
    nodes = {clip_frames(name)[0][:5] for name in motion.graph.node_names}
    assert {name for name in nodes if name.startswith("16_")} <= gait
    assert sum(note.startswith(f"agents walk at {speed:.2f} m/s") for note in motion.notes) == 1
    simulation = crowdsim.Simulation(scenario, behavior_set=motion)
    with simulation.run(tmp_path / "gaits.h5") as recording:
        x, rate, summary = recording.x[:].astype(float), recording.steps_per_second, recording.summary
    assert summary["arrived"] == 2
    for agent in range(2):
        walked = np.flatnonzero((x[:, agent] > 6.0) & (x[:, agent] < 18.0))
        assert (np.diff(x[walked, agent]) * rate).mean() == pytest.approx(speed, rel=0.05)


def test_without_a_speed_all_gaits_are_walked(shared: Path, tmp_path: Path) -> None:
    file = tmp_path / "gaits.yaml"
    text = LANE.format(folder=shared / "mocap", speed=1.0, locomotion="captured")
    file.write_text(text.replace("    speed: 1.0\n", ""))
    motion = load_behaviors(crowdsim.load_scenario(file))
    nodes = {clip_frames(name)[0][:5] for name in motion.graph.node_names}
    assert nodes & SLOW
    assert nodes & NORMAL
    assert nodes & BRISK
    assert not any(note.startswith("agents walk at") for note in motion.notes)
