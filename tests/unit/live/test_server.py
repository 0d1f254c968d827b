"""The server of live simulations: who may connect, what it refuses, and that nothing of it ends it."""

import asyncio
import json
import random
import socket as sockets
import time
import urllib.error
import urllib.request
from concurrent.futures import Future
from contextlib import ExitStack
from urllib.parse import urlsplit

import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from crowdsim.errors import CrowdSimError
from crowdsim.live.clients import MOST_PICTURES, Audience
from crowdsim.live.pictures import MAGIC
from crowdsim.live.requests import MOST_BYTES, RequestRefused
from crowdsim.live.server import MOST_PAGES, Server
from tests.support.live import ask, closing_of, mutated
from tests.unit.live.test_requests import GOOD

PAGE, OPENING = b"<!doctype html>page", b"\x1f\x8bopening"


class Asked(list):
    """Requests that came; those about the agent 13 are refused."""

    def __call__(self, request):
        self.append(request)
        answer = Future()
        if 13 in getattr(request, "agents", ()):
            answer.set_exception(RequestRefused("there is no agent 13"))
        else:
            answer.set_result({"words": "done", "step": len(self)})
        return answer


@pytest.fixture
def asked():
    return Asked()


@pytest.fixture
def server(asked):
    with Server(PAGE, OPENING, "127.0.0.1", 0, asked) as opened:
        yield opened


def socket_of(server, origin=None, token=None, path="/live", **options):
    parts = urlsplit(server.address)
    address = f"ws://{parts.netloc}{path}?token={server.token if token is None else token}"
    return connect(address, origin=f"http://{parts.netloc}" if origin is None else origin, **options)


def status_of(address, **headers):
    try:
        with urllib.request.urlopen(urllib.request.Request(address, headers=headers), timeout=10) as answer:
            return answer.status, answer.read()
    except urllib.error.HTTPError as error:
        return error.code, error.read()


def test_the_page_is_served_to_whom_the_address_was_told(server):
    assert status_of(server.address) == (200, PAGE)
    parts = urlsplit(server.address)
    for query in ("", "?token=", "?token=wrong", f"?token={server.token}x", f"?other={server.token}"):
        status, words = status_of(f"http://{parts.netloc}/{query}")
        assert status == 403
        assert b"wrong token" in words
        assert server.token.encode() not in words
    assert status_of(f"http://{parts.netloc}/other?token={server.token}")[0] == 404


def test_two_servers_have_two_tokens(server):
    with Server(PAGE, OPENING, "127.0.0.1", 0) as other:
        assert other.token != server.token
        assert len(other.token) >= 24


@pytest.mark.parametrize("host", ["0.0.0.0", "::"])
def test_an_address_for_all_names_a_machine_that_others_can_reach(host):
    if host == "::" and not sockets.has_dualstack_ipv6():
        pytest.skip("this machine has no IPv6")
    with Server(PAGE, OPENING, host, 0) as opened:
        assert urlsplit(opened.address).hostname == sockets.gethostname().lower()
        assert urlsplit(opened.local_address).hostname == "127.0.0.1"
        assert urlsplit(opened.address).query == urlsplit(opened.local_address).query
        if host == "0.0.0.0":
            assert status_of(opened.local_address, Host=urlsplit(opened.address).netloc)[0] == 200


def test_names_of_other_sites_that_lead_here_are_refused(server):
    assert status_of(server.address, Host="evil.example")[0] == 403
    assert status_of(server.address, Host="localhost:1234")[0] == 200


@pytest.mark.parametrize(
    "wrong",
    [
        {"token": "wrong"},
        {"token": ""},
        {"origin": "http://evil.example"},
        {"origin": "https://127.0.0.1"},
        {"origin": "null"},
        {"path": "/other"},
    ],
    ids=str,
)
def test_sockets_of_others_are_refused(server, wrong):
    with pytest.raises(InvalidStatus) as refused, socket_of(server, **wrong):
        pass
    assert refused.value.response.status_code in (403, 404)
    with socket_of(server) as socket:
        assert socket.recv(timeout=10) == OPENING


def test_a_socket_without_origin_is_refused(server):
    parts = urlsplit(server.address)
    with pytest.raises(InvalidStatus) as refused, connect(f"ws://{parts.netloc}/live?token={server.token}"):
        pass
    assert refused.value.response.status_code == 403


def test_requests_are_answered_and_refusals_say_why(server, asked):
    with socket_of(server) as socket:
        for number, request in enumerate(GOOD):
            answer = ask(socket, {"id": number, **request})
            assert answer == {"kind": "answer", "id": number, "ok": True, "words": "done", "step": number + 1}
        refused = ask(socket, {"id": 99, "do": "remove_agents", "agents": [13]})
        assert refused == {"kind": "answer", "id": 99, "ok": False, "words": "there is no agent 13"}
        assert ask(socket, b"\x00\xff")["ok"] is False
    assert [request.do for request in asked[: len(GOOD)]] == [request["do"] for request in GOOD]


def test_a_thousand_mutated_messages_leave_the_server_as_it_was(server):
    draws = random.Random(5)
    refused = 0
    with socket_of(server) as socket:
        for number in range(1000):
            answer = ask(socket, mutated({"id": number, **draws.choice(GOOD)}, draws))
            refused += not answer["ok"]
            assert answer["words"]
        assert refused > 800
        assert ask(socket, {"id": 5, "do": "step"})["ok"]
    assert status_of(server.address)[0] == 200


def test_huge_messages_and_broken_frames_end_their_own_connection_only(server):
    with socket_of(server) as good:
        with socket_of(server) as bad:
            bad.send("x" * (MOST_BYTES + 1))
            assert closing_of(bad).rcvd.code == 1009
        with socket_of(server) as bad:
            bad.socket.sendall(bytes([0xFF] * 64))
            assert closing_of(bad)
        assert ask(good, {"id": 1, "do": "step"})["ok"]


def test_only_so_many_pages_watch(server):
    with ExitStack() as opened:
        for _ in range(MOST_PAGES - 1):
            assert opened.enter_context(socket_of(server)).recv(timeout=10) == OPENING
        with socket_of(server) as last:
            assert last.recv(timeout=10) == OPENING
            with pytest.raises(InvalidStatus) as refused, socket_of(server):
                pass
            assert refused.value.response.status_code == 503
        time.sleep(0.5)
        with socket_of(server) as again:
            assert again.recv(timeout=10) == OPENING


def test_who_comes_later_gets_the_present_moment(server):
    server.things('{"kind":"things","things":[]}')
    server.state('{"kind":"state"}')
    server.picture(MAGIC + b"1")
    server.picture(MAGIC + b"2")
    with socket_of(server) as socket:
        came = [socket.recv(timeout=10) for _ in range(4)]
    assert came == [OPENING, '{"kind":"things","things":[]}', '{"kind":"state"}', MAGIC + b"2"]


def test_slow_pages_lose_pictures_and_cost_the_simulation_nothing(server):
    size, count = 200_000, 400
    with socket_of(server, max_queue=1) as slow, socket_of(server, max_queue=None, max_size=None) as quick:
        assert slow.recv(timeout=10) == quick.recv(timeout=10) == OPENING
        took = []
        for number in range(count):
            began = time.perf_counter()
            server.picture(number.to_bytes(4, "little") + bytes(size))
            took.append(time.perf_counter() - began)
            quick.recv(timeout=10)
        assert max(took) < 0.5
        came = []
        while not came or came[-1] < count - 1:
            came.append(int.from_bytes(slow.recv(timeout=10)[:4], "little"))
    assert came == sorted(came)
    assert len(came) < count


def test_a_page_has_room_for_a_few_pictures():
    audience = Audience()
    client = audience.join()
    for number in range(MOST_PICTURES + 5):
        audience.show(bytes([number]))
    waiting = [asyncio.run(client.next()) for _ in range(MOST_PICTURES)]
    assert waiting == [bytes([number]) for number in range(5, MOST_PICTURES + 5)]


def test_an_address_that_is_taken_is_refused_in_words(server):
    port = urlsplit(server.address).port
    with pytest.raises(CrowdSimError, match="choose another --port"), Server(PAGE, OPENING, "127.0.0.1", port):
        pass


class Never(list):
    """Requests that came; none is ever answered."""

    def __call__(self, request):
        self.append((request, Future()))
        return self[-1][1]


def test_a_server_ends_though_answers_are_missing_and_nothing_is_sent():
    never = Never()
    with Server(PAGE, OPENING, "127.0.0.1", 0, never) as opened, socket_of(opened) as socket:
        assert socket.recv(timeout=10) == OPENING
        socket.send(json.dumps({"id": 1, **GOOD[0]}))
        while not never:
            time.sleep(0.01)
        ends = time.monotonic() + 10.0
        opened.__exit__()
        assert time.monotonic() < ends
        closing_of(socket)


def test_a_request_of_a_page_that_has_gone_is_canceled():
    never = Never()
    with Server(PAGE, OPENING, "127.0.0.1", 0, never) as opened:
        with socket_of(opened) as socket:
            socket.send(json.dumps({"id": 1, **GOOD[0]}))
            while not never:
                time.sleep(0.01)
        ends = time.monotonic() + 10.0
        while not never[0][1].cancelled():
            assert time.monotonic() < ends
            time.sleep(0.01)
