"""``crowdsim serve`` as a process of its own, attacked: all of it is refused, and the simulation goes on."""

import json
import os
import random
import signal
import socket as sockets
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple
from urllib.parse import parse_qs, urlsplit

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from crowdsim import Recording, Simulation, load_scenario
from crowdsim.cli.errors_shown import INTERRUPTED
from crowdsim.live.pictures import MAGIC
from crowdsim.live.requests import MOST_BYTES
from tests.support.live import ask, closing_of, mutated
from tests.unit.live.test_session import hall

MUTATED = 1000
REQUESTS = [
    {"do": "set_goal", "agents": [0, 2], "goal": [8.5, 4], "on_arrival": "stay"},
    {"do": "remove_agents", "agents": [1]},
    {"do": "add", "group": "guests", "count": 1},
    {"do": "add", "group": "guests", "count": 1, "start": [3, 5]},
    {"do": "move", "name": "cart", "by": [0.25, -0.1]},
    {"do": "draw_wall", "points": [[4, 5], [4, 6.5]]},
    {"do": "remove_obstacle", "name": "drawn wall 1"},
    {"do": "set_door", "name": "gate", "open": False},
    {"do": "set_door", "name": "gate", "open": True},
    {"do": "pause", "paused": False},
    {"do": "step"},
    {"do": "set_speed", "speed": 8},
]
"""What a page may ask of the hall."""


class Served(NamedTuple):
    """A running command: its process, and the address, name and port, and token that it printed."""

    process: subprocess.Popen[str]
    address: str
    place: str
    token: str

    def socket(self, origin: str | None = None, token: str | None = None) -> ClientConnection:
        """Connect as the page does."""
        address = f"ws://{self.place}/live?token={self.token if token is None else token}"
        return connect(address, origin=origin or f"http://{self.place}", max_size=None)

    def is_alive(self) -> bool:
        """Whether it answers a page that comes now, and its simulation goes on."""
        with self.socket() as socket:
            for request in ({"do": "set_speed", "speed": 8}, {"do": "pause", "paused": False}):
                assert ask(socket, {"id": 1, **request})["ok"]
            step = picture_of(socket)
            return self.process.poll() is None and picture_of(socket, step + 5) >= step + 5


def picture_of(socket: ClientConnection, least: int = 0) -> int:
    """The step of the next picture from ``least`` on."""
    ends = time.monotonic() + 30.0
    while time.monotonic() < ends:
        message = socket.recv(timeout=30)
        if isinstance(message, bytes) and message.startswith(MAGIC):
            step = int(np.frombuffer(message, "<u4", 1, len(MAGIC))[0])
            if step >= least:
                return step
    raise AssertionError(f"no picture of step {least} came")


@pytest.fixture(params=["captured", "auto"])
def served(request: pytest.FixtureRequest, tmp_path: Path, environment: dict[str, str]) -> Iterator[Served]:
    hall(request.param, duration=3600, rounds=1000).save(tmp_path / "hall.yaml")
    command = [
        sys.executable,
        "-m",
        "crowdsim",
        "serve",
        "hall.yaml",
        "--port",
        "0",
        "--speed",
        "8",
        "--record",
        "r.h5",
    ]
    with subprocess.Popen(
        command, cwd=tmp_path, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            address = process.stdout.readline().strip()
            parts = urlsplit(address)
            yield Served(process, address, parts.netloc, parse_qs(parts.query)["token"][0])
        finally:
            process.kill()


def test_attacks_are_refused_and_the_session_can_be_run_again(served: Served, tmp_path: Path) -> None:
    assert served.is_alive()
    refuse_mutated(served)
    refuse_huge(served)
    refuse_strangers(served)
    refuse_what_is_no_http(served)
    assert served.is_alive()
    # What was well-formed by chance was carried out, and recorded.
    os.kill(served.process.pid, signal.SIGINT)
    _, said = served.process.communicate(timeout=120)
    assert served.process.returncode == INTERRUPTED, said
    assert "Traceback" not in said
    with Recording.open(tmp_path / "r.h5") as recording, Simulation(load_scenario(tmp_path / "r.yaml")) as again:
        assert recording.complete
        assert recording.commands
        for wanted in recording.state_hash[:]:
            again.step()
            assert again.state_hash == wanted


def refuse_mutated(served: Served) -> None:
    draws, refused = random.Random(11), 0
    with served.socket() as socket:
        for number in range(MUTATED):
            answer = ask(socket, mutated({"id": number, **draws.choice(REQUESTS)}, draws))
            refused += not answer["ok"]
            assert answer["words"]
            assert "\n" not in answer["words"]
    assert 0.8 * MUTATED < refused < MUTATED


def refuse_huge(served: Served) -> None:
    with served.socket() as good:
        for size in (MOST_BYTES + 1, 1_000_000, 50_000_000):
            for content in ("[" * size, '{"id": 1, "do": "' + "x" * size + '"}', bytes(size)):
                with served.socket() as bad:
                    with suppress(ConnectionClosed):  # the server does not wait for all of it
                        bad.send(content)
                    assert closing_of(bad).rcvd.code == 1009
        # As large as may be, and deep: read, and refused in words.
        for content in (
            "[" * MOST_BYTES,
            "9" * MOST_BYTES,
            '{"a":' * (MOST_BYTES // 5),
            '"' + "x" * (MOST_BYTES - 2) + '"',
        ):
            assert not ask(good, content)["ok"]
        with served.socket() as bad:
            bad.socket.sendall(bytes([0xFF] * 64))
            assert closing_of(bad)
        assert ask(good, {"id": 1, "do": "pause", "paused": False})["ok"]


def refuse_strangers(served: Served) -> None:
    for wrong in (
        {"token": "wrong"},
        {"token": ""},
        {"token": served.token[:-1]},
        {"token": served.token + "x"},
        {"origin": "http://evil.example"},
        {"origin": "null"},
        {"origin": f"https://{served.place}"},
        {"origin": f"http://{served.place}.evil.example"},
    ):
        with pytest.raises(InvalidStatus) as refused, served.socket(**wrong):
            pass
        assert refused.value.response.status_code == 403, wrong
    for address, headers in (
        (f"http://{served.place}/", {}),
        (f"http://{served.place}/?token=wrong", {}),
        (served.address, {"Host": "evil.example"}),
    ):
        with pytest.raises(urllib.error.HTTPError) as answer:
            urllib.request.urlopen(urllib.request.Request(address, headers=headers), timeout=10)
        assert answer.value.code == 403
        assert served.token.encode() not in answer.value.read()


def refuse_what_is_no_http(served: Served) -> None:
    draws, port = random.Random(12), urlsplit(served.address).port
    greeting = f"GET /live?token={served.token} HTTP/1.1\r\nHost: {served.place}\r\nUpgrade: websocket\r\n"
    contents = [draws.randbytes(400), b"\r\n\r\n", b"GET / HTTP/1.1\r\n" + b"X: " + b"y" * 100_000, greeting.encode()]
    for content in [*contents, *(json.dumps(request).encode() for request in REQUESTS)]:
        with sockets.create_connection(("127.0.0.1", port), timeout=10) as raw:
            raw.sendall(content)
            raw.shutdown(sockets.SHUT_WR)
            said = b""
            with suppress(ConnectionResetError):
                while more := raw.recv(4096):
                    said += more
            assert b" 101 " not in said
