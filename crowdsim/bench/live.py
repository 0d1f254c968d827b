"""Live simulations: how many steps come late, and how soon a click takes effect, with a page that watches.

A hundred agents walk to and fro. A client in a process of its own reads every picture, as the page does, and sends
an agent elsewhere again and again.
"""

from __future__ import annotations

import json
import multiprocessing
import time
from importlib.util import find_spec
from multiprocessing.connection import Connection
from typing import Any
from urllib.parse import urlsplit

import numpy as np

from crowdsim.bench.registry import Measurement
from crowdsim.crowd.simulation import Simulation
from crowdsim.errors import CrowdSimError
from crowdsim.live.pictures import MAGIC
from crowdsim.scenario.loader import parse_scenario
from crowdsim.scenario.scenario import Scenario

SECONDS = 60.0
"""Default time for which each simulation is watched [s]."""
AGENTS = 100
BETWEEN_CLICKS = 0.5
"""Time between the picture that shows the effect of a click and the next click [s]."""

_LEVELS = {"captured": 30, "auto": 10, "steered": 10}
"""Steps a second by level; those with steered agents are fixed."""
_HALL = """
crowdsim: 1
name: hall
seed: 1
duration: 86400
steps_per_second: {rate}
floor: {{rectangle: [0, 0, 40, 30]}}
obstacles:
  - {{name: cart, box: {{center: [20, 15], size: [2, 2]}}, top: 0.9}}
agents:
  - {{name: west, count: {west}, locomotion: {level}, start: {{rectangle: [1, 1, 15, 29]}},
      goals: [{{rectangle: [25, 1, 39, 29]}}, {{rectangle: [1, 1, 15, 29]}}], repeat: 1000}}
  - {{name: east, count: {east}, locomotion: {level}, start: {{rectangle: [25, 1, 39, 29]}},
      goals: [{{rectangle: [1, 1, 15, 29]}}, {{rectangle: [25, 1, 39, 29]}}], repeat: 1000}}
"""


def measure(seconds: float = SECONDS, agents: int = AGENTS) -> Measurement:
    """Watch a simulation of each level for ``seconds`` of real time, with ``agents`` agents.

    A client begins to watch and click when all agents have come, or after 60 simulated seconds.
    """
    if find_spec("websockets") is None:
        raise CrowdSimError("websockets is not installed; pip install 'crowdsim[live]'")
    rows = [_watched(level, rate, seconds, agents) for level, rate in _LEVELS.items()]
    figures = {f"{row['locomotion']}_{name}": float(row[name]) for row in rows for name in row if name != "locomotion"}
    headline = tuple(f"{level}_{name}" for level in _LEVELS for name in ("late_percent", "click_steps_most"))
    return Measurement(rows, figures, headline)


def hall(level: str, rate: int, agents: int) -> Scenario:
    """Return a hall in which ``agents``, half of them from each end, walk to and fro, at ``rate`` steps a second."""
    return parse_scenario(_HALL.format(rate=rate, level=level, west=agents // 2, east=agents - agents // 2))


def _watched(level: str, rate: int, seconds: float, agents: int) -> dict[str, Any]:
    """Return the row of one level with ``agents`` agents, at ``rate`` steps a second, watched for ``seconds``."""
    from crowdsim.live.opening import pack_opening
    from crowdsim.live.page import live_page
    from crowdsim.live.server import Server
    from crowdsim.live.session import Session

    with Simulation(hall(level, rate, agents)) as simulation:
        # All have come before the clock begins: a page is opened on what runs.
        while len(simulation.agents.present) < agents and simulation.time < 60.0:
            simulation.step()
        begun: list[float] = []
        with Server(live_page("hall"), pack_opening(simulation), "127.0.0.1", 0) as server:
            # The session ends ``seconds`` after the client has begun to watch.
            session = Session(simulation, server, lambda: time.perf_counter() > begun[0] + seconds)
            server.ask = session.ask
            mine, its = multiprocessing.get_context("spawn").Pipe()
            client = multiprocessing.get_context("spawn").Process(target=click, args=(server.address, agents, its))
            client.start()
            its.close()
            mine.recv()  # the client watches
            begun.append(time.perf_counter())
            session.step_until_stopped(None)
        clicks = mine.recv()
        client.join()
    steps, milliseconds = np.array(clicks["steps"]), np.array(clicks["milliseconds"])
    # There is a picture after each step, and one before the first.
    return {
        "locomotion": level,
        "agents": agents,
        "steps_per_second": rate,
        "steps": session.steps,
        "late_percent": round(100.0 * session.late / max(session.steps, 1), 2),
        "pictures_lost": session.steps + 1 - clicks["pictures"],
        "clicks": len(steps),
        "click_steps_most": int(steps.max(initial=0)),
        "click_ms_median": round(float(np.median(milliseconds)), 1) if len(steps) else 0.0,
        "click_ms_most": round(float(milliseconds.max(initial=0.0)), 1),
    }


def click(address: str, agents: int, out: Connection) -> None:
    """Watch the page at ``address`` until it ends, and send one agent elsewhere with each click.

    ``agents`` is the number of agents. Send True to ``out`` when this process watches, and a dict at the end:
    ``pictures`` is the number of pictures that came. ``steps`` has for each click the number of steps from the picture
    last seen to the step in which the click took effect; ``milliseconds`` the time until the picture of that step came.
    """
    from websockets.exceptions import ConnectionClosed
    from websockets.sync.client import connect
    from websockets.typing import Origin

    parts = urlsplit(address)
    found = _Clicks(agents)
    try:
        place, origin = f"ws://{parts.netloc}/live?{parts.query}", Origin(f"http://{parts.netloc}")
        with connect(place, origin=origin, max_size=None) as socket:
            out.send(True)
            while True:
                answer = found.take(socket.recv(), time.perf_counter())
                if answer is not None:
                    socket.send(answer)
    except ConnectionClosed:
        pass  # the simulation has ended
    out.send({"pictures": found.pictures, "steps": found.steps, "milliseconds": found.milliseconds})


class _Clicks:
    """Clicks one after the other, each after the one before has taken effect; ``agents`` is the number of agents.

    ``pictures`` is the number of pictures that came; ``steps`` and ``milliseconds`` are by click, see :func:`click`.
    """

    def __init__(self, agents: int) -> None:
        self.pictures = 0
        self._agents = agents
        self.steps: list[int] = []
        self.milliseconds: list[float] = []
        self._draws = np.random.default_rng(1)
        # Steps of the last picture and of the picture seen at the last click, -1 before the first; and the step in
        # which the click takes effect, None if no click is under way or its answer has not come.
        self._seen = self._sent = -1
        self._waits: int | None = None
        self._began, self._next = 0.0, time.perf_counter() + BETWEEN_CLICKS

    def take(self, message: str | bytes, now: float) -> str | None:
        """Take a message that came at ``now`` [s]; return a request if it is time for a click."""
        if isinstance(message, bytes) and message.startswith(MAGIC):
            self._seen = int(np.frombuffer(message, "<u4", 1, len(MAGIC))[0])
            self.pictures += 1
            if self._waits is not None and self._seen >= self._waits:
                self.milliseconds.append(1e3 * (now - self._began))
                self._waits, self._next = None, now + BETWEEN_CLICKS
        elif isinstance(message, str) and (answer := json.loads(message))["kind"] == "answer":
            # The answer names the step in which the request is carried out; a refusal does not, and is clicked again.
            if answer["ok"]:
                self._waits = int(answer["step"])
                self.steps.append(self._waits - self._sent)
            else:
                self._next = now
        if now < self._next or self._seen < 0:
            return None
        # Goals lie to the south of the cart. The next click waits for the picture that shows this one, or a refusal.
        self._sent, self._began, self._next = self._seen, now, np.inf
        goal = [float(self._draws.uniform(1.0, 39.0)), float(self._draws.uniform(2.0, 12.0))]
        agent = int(self._draws.integers(self._agents))
        return json.dumps({"id": 1, "do": "set_goal", "agents": [agent], "goal": goal, "on_arrival": "stay"})
