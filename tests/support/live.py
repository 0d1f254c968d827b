"""A live simulation in this process: its session in a thread, its server, and what it published."""

from __future__ import annotations

import json
import random
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection

from crowdsim import Simulation
from crowdsim.live.opening import pack_opening
from crowdsim.live.page import live_page
from crowdsim.live.pictures import MAGIC
from crowdsim.live.requests import read_request
from crowdsim.live.server import Server
from crowdsim.live.session import Session
from crowdsim.scenario.scenario import Scenario


class Told:
    """A publisher that keeps everything, and hands it on to a server if there is one."""

    def __init__(self, server: Server | None = None) -> None:
        self.server = server
        self.pictures: list[bytes] = []
        self.all_things: list[list[dict[str, Any]]] = []
        self.states: list[dict[str, Any]] = []
        self.order: list[str] = []

    def picture(self, content: bytes) -> None:
        self.pictures.append(content)
        self.order.append("picture")
        if self.server is not None:
            self.server.picture(content)

    def things(self, message: str) -> None:
        self.all_things.append(json.loads(message)["things"])
        self.order.append("things")
        if self.server is not None:
            self.server.things(message)

    def state(self, message: str) -> None:
        self.states.append(json.loads(message))
        if self.server is not None:
            self.server.state(message)

    def thing(self, name: str) -> dict[str, Any]:
        """A thing as it was told last."""
        return next(thing for thing in self.all_things[-1] if thing["name"] == name)


class Live:
    """A simulation, its session and what it told; ``ask(do=..., ...)`` gives the answer."""

    def __init__(self, simulation: Simulation, session: Session, told: Told) -> None:
        self.simulation, self.session, self.told = simulation, session, told

    def ask(self, **request: Any) -> dict[str, Any]:
        return self.session.ask(read_request(json.dumps({"id": 1, **request}))).result(timeout=60)

    def wait(self, condition: Any, seconds: float = 60.0) -> None:
        ends = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < ends, f"not in {seconds:g} s"
            time.sleep(0.005)


@contextmanager
def living(scenario: Scenario, record: Path | None = None, speed: float = 1.0, page: bool = False) -> Iterator[Live]:
    """Run a scenario live until the block ends; with ``page`` also serve it."""
    stop = threading.Event()
    failed: list[BaseException] = []
    with Simulation(scenario) as simulation:
        server = Server(live_page(scenario.name), pack_opening(simulation), "127.0.0.1", 0) if page else None
        told = Told(server)
        session = Session(simulation, told, stop.is_set, speed)

        def run() -> None:
            try:
                session.step_until_stopped(record)
            except BaseException as error:
                failed.append(error)

        thread = threading.Thread(target=run)
        if server is not None:
            server.ask = session.ask
            server.__enter__()
        thread.start()
        try:
            yield Live(simulation, session, told)
        finally:
            stop.set()
            thread.join(timeout=120)
            if server is not None:
                server.__exit__()
    if failed:
        raise failed[0]


def ask(socket: ClientConnection, message: Any) -> dict[str, Any]:
    """Send a message as a page does, and return the answer to it."""
    socket.send(message if isinstance(message, str | bytes) else json.dumps(message))
    while True:
        answer = socket.recv(timeout=60)
        if isinstance(answer, str) and json.loads(answer)["kind"] == "answer":
            return json.loads(answer)


def closing_of(socket: ClientConnection) -> ConnectionClosed:
    """How a connection ended, after all that came before."""
    while True:
        try:
            socket.recv(timeout=10)
        except ConnectionClosed as closed:
            return closed


def mutated(request: dict[str, Any], draws: random.Random) -> str | bytes:
    """A request with one to four random faults, mostly as text."""
    message = bytearray(json.dumps(request).encode())
    for _ in range(draws.randint(1, 4)):
        place = draws.randrange(len(message) + 1)
        match draws.randrange(3):
            case 0:
                message[place : place + draws.randint(1, 9)] = b""
            case 1:
                message[place:place] = draws.randbytes(draws.randint(1, 5))
            case _:
                message[place : place + 1] = draws.choice([b'"', b"[", b"{", b"\x00", b"9" * 400, b"-", b"e9"])
    return message.decode("utf-8", "replace") if draws.randrange(8) else bytes(message)


def read_picture(content: bytes, columns: tuple[tuple[str, str], ...]) -> tuple[int, dict[str, np.ndarray]]:
    """Step and columns of a picture: a slow twin of the page's reader."""
    assert content[:4] == MAGIC
    step, rows = np.frombuffer(content, "<u4", 2, 4).tolist()
    at, found = 12, {}
    for name, kind in columns:
        found[name] = np.frombuffer(content, kind, rows, at)
        at += found[name].nbytes
    assert at == len(content)
    return step, found
