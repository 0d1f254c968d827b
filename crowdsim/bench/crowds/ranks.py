"""A steered run on several processes: time of a step and bytes exchanged, and what that predicts for more of them.

People walk both ways over a square at 1 /m2. Runs on one process and on several alternate; figures are medians of the
runs. ``work`` is CPU time without that of waiting for others. On k processes a step, and its part of writing the
recording, takes ``whole + divided / k``: what every process does again or waits for, and what the regions share. Both
follow from the times with one and with two processes.
"""

from __future__ import annotations

import json
import math
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from crowdsim.bench.registry import Measurement
from crowdsim.crowd.ranks.launch import INSTALL, find_mpiexec
from crowdsim.errors import CrowdSimError

COUNT = 20_000
"""Number of agents."""

PREDICTED = (8, 64, 512)
"""Numbers of processes to predict for, with as many agents each as one process has here."""

_SCENARIO = """\
crowdsim: 1
name: both_ways
seed: 1
duration: {seconds}
floor: {{rectangle: [0, 0, {side}, {side}]}}
agents:
  - {{name: east, locomotion: steered, count: {half}, start: {{rectangle: [0, 0, {side}, {side}]}},
     goal: {{rectangle: [{far}, 0, {side}, {side}]}}}}
  - {{name: west, locomotion: steered, count: {half}, start: {{rectangle: [0, 0, {side}, {side}]}},
     goal: {{rectangle: [0, 0, 2, {side}]}}}}
"""


MOST_RANKS = 4
"""Largest number of processes whose states are compared."""

_PLAZA = """\
crowdsim: 1
name: plaza
seed: 1
duration: {seconds}
floor: {{rectangle: [0, 0, {side}, {side}]}}
obstacles:
  - {{name: fountain, cylinder: {{center: [{middle}, {middle}], radius: {fountain}}}, top: 1}}
  - {{name: kiosk, box: {{center: [{fountain}, {middle}], size: [2, 1]}}, top: 2.5}}
exits:
  - {{name: north, rectangle: [0, {far}, {side}, {side}]}}
  - {{name: east, rectangle: [{far}, 0, {side}, {side}]}}
agents:
  - {{name: leave, locomotion: steered, count: {half}, start: {{rectangle: [0, 0, {side}, {side}]}},
     exits: [north, east], choice: quickest}}
  - {{name: cross, locomotion: steered, count: {half}, start: {{rectangle: [0, 0, {side}, {side}]}},
     goal: {{rectangle: [0, 0, 2, {side}]}}}}
"""

_STREET = """\
crowdsim: 1
name: street
seed: 1
duration: {seconds}
floor: {{rectangle: [0, 0, {long}, {wide}]}}
agents:
  - {{name: east, locomotion: steered, count: {half}, start: {{rectangle: [0, 0, {long}, {wide}]}},
     goal: {{rectangle: [{end}, 0, {long}, {wide}]}}}}
  - {{name: west, locomotion: steered, count: {half}, start: {{rectangle: [0, 0, {long}, {wide}]}},
     goal: {{rectangle: [0, 0, 2, {wide}]}}}}
"""


_FIGURES = ("run_ms", "work_ms", "step_ms", "exchange_ms", "sent_kb")
"""Figures of a run, all of one step.

``run`` is its time with its part of writing the recording, a mean; ``step`` its median without that; ``work`` the mean
CPU time of the busiest process; ``exchange`` the median time of the exchange of ghosts; ``sent`` the kB of the process
that sends most, a mean.
"""


def measure(count: int = COUNT, seconds: float = 12.0, rounds: int = 3) -> Measurement:
    """Run ``count`` agents for some simulated seconds on one and on two processes, ``rounds`` times in turn.

    Half as many on a plaza and in a street are run on one to MOST_RANKS processes, whose states must be the same.

    Raises
    ------
    CrowdSimError
        If there is no mpiexec, or a run fails.
    """
    mpiexec = find_mpiexec()
    if mpiexec is None:
        raise CrowdSimError(f"there is no mpiexec; install MPI, or: {INSTALL}")
    side = round(math.sqrt(count), 1)
    text = _SCENARIO.format(seconds=seconds, side=side, half=count // 2, far=side - 2.0)
    found: dict[int, list[dict[str, Any]]] = {number: [] for number in (1, 2)}
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "square.yaml").write_text(text, encoding="utf-8")
        for _ in range(rounds):
            for number in found:
                found[number].append(_run(mpiexec, number, folder))
        compared = _compare(mpiexec, folder, count // 2, min(seconds, 2.0))
    if len({run["state_hash"] for runs in found.values() for run in runs}) > 1:
        raise CrowdSimError("runs on different numbers of processes gave different states; this is a bug")
    rows = []
    for number, runs in found.items():
        middle = {name: statistics.median(run[name] for run in runs) for name in _FIGURES}
        rows.append(
            {
                "ranks": number,
                "characters": count,
                "run_ms": round(middle["run_ms"], 2),
                "work_ms": round(middle["work_ms"], 2),
                "step_ms": round(middle["step_ms"], 2),
                "exchange_ms": round(middle["exchange_ms"], 3),
                "exchange_share": round(middle["exchange_ms"] / middle["step_ms"], 4),
                "sent_kb_a_step": round(middle["sent_kb"], 1),
                "measured": True,
            }
        )
    figures = {f"{row['ranks']}_ranks_run_ms": row["run_ms"] for row in rows}
    figures |= {f"{row['ranks']}_ranks_exchange_share": row["exchange_share"] for row in rows}
    times = {row["ranks"]: row for row in rows}
    one, two = (times[number]["run_ms"] for number in (1, 2))
    figures["step_speed_up_of_two"] = round(times[1]["step_ms"] / times[2]["step_ms"], 2)
    figures["speed_up_of_two"] = round(one / two, 2)
    figures["work_speed_up_of_two"] = round(times[1]["work_ms"] / times[2]["work_ms"], 2)
    # run_ms, a step with its part of the writing, is whole + divided on one process, whole + divided / 2 on two. In
    # noisy times the difference may be negative, which has no meaning.
    whole = max(2.0 * two - one, 0.0)
    # What each process does again grows with the whole crowd, what the regions share stays the same.
    unknown = {
        "work_ms": None,
        "step_ms": None,
        "exchange_ms": None,
        "exchange_share": None,
        "sent_kb_a_step": None,
        "measured": False,
    }
    rows += [
        {"ranks": number, "characters": number * count, "run_ms": round(one - whole + number * whole, 2), **unknown}
        for number in PREDICTED
    ]
    figures["whole_ms"] = round(whole, 2)
    figures["runs_with_equal_states"] = compared
    return Measurement(
        rows,
        figures,
        ("step_speed_up_of_two", "speed_up_of_two", "work_speed_up_of_two", "whole_ms", "runs_with_equal_states"),
    )


def _compare(mpiexec: str, folder: str, count: int, seconds: float) -> int:
    """Run a plaza and a street on one to MOST_RANKS processes; return how many runs have had the same states.

    ``count`` people have 1.2 m2 each, on a square or in a street 30 times as long as wide.
    """
    side, wide = round(math.sqrt(1.2 * count), 1), round(math.sqrt(0.04 * count), 1)
    long = round(30.0 * wide, 1)
    both = {"seconds": seconds, "half": count // 2}
    plaza = {"side": side, "far": side - 2.0, "middle": 0.5 * side, "fountain": round(0.1 * side, 1)}
    street = {"long": long, "wide": wide, "end": long - 2.0}
    compared = 0
    for file, text in (
        ("plaza.yaml", _PLAZA.format(**both, **plaza)),
        ("street.yaml", _STREET.format(**both, **street)),
    ):
        (Path(folder) / file).write_text(text, encoding="utf-8")
        states = [_run(mpiexec, number, folder, file)["state_hash"] for number in range(1, MOST_RANKS + 1)]
        if len(set(states)) > 1:
            raise CrowdSimError(f"{file}: 1 to {MOST_RANKS} processes gave the states {states}; this is a bug")
        compared += len(states)
    return compared


def _run(mpiexec: str, number: int, folder: str, file: str = "square.yaml") -> dict[str, Any]:
    """Return the figures of one run of the scenario ``file`` in ``folder`` on ``number`` processes."""
    command = [mpiexec, "-n", str(number), sys.executable, "-m", "crowdsim.bench.crowds.ranked_steps", file]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    if done.returncode:
        raise CrowdSimError(f"a run on {number} processes failed: {done.stderr[-400:]}")
    figures: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return figures
