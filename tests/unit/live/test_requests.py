"""What pages ask for: well-formed requests are read, all others are refused in words."""

import json

import pytest

from crowdsim.live.requests import DrawWall, RequestRefused, SetGoal, number_of, read_request

GOOD = [
    {"do": "set_goal", "agents": [3], "goal": [1.5, 2], "on_arrival": "stay"},
    {"do": "remove_agents", "agents": [0, 1]},
    {"do": "add", "group": "guests", "count": 2},
    {"do": "add", "group": "guests", "count": 2, "start": [1, 1]},
    {"do": "move", "name": "cart", "by": [0.5, -1]},
    {"do": "draw_wall", "points": [[0, 0], [2, 0]]},
    {"do": "remove_obstacle", "name": "cart"},
    {"do": "set_door", "name": "gate", "open": True},
    {"do": "pause", "paused": False},
    {"do": "step"},
    {"do": "set_speed", "speed": 2},
]


@pytest.mark.parametrize("asked", GOOD, ids=lambda asked: asked["do"])
def test_requests_are_read(asked):
    request = read_request(json.dumps({"id": 7, **asked}))
    assert request.id == 7
    assert request.do == asked["do"]


def test_a_goal_is_read_as_it_was_sent():
    request = read_request('{"id": 1, "do": "set_goal", "agents": [3, 4], "goal": [1.5, 2]}')
    assert request == SetGoal(id=1, do="set_goal", agents=(3, 4), goal=(1.5, 2.0))


@pytest.mark.parametrize(
    ("message", "said"),
    [
        ("", "no request"),
        ("[]", "no request"),
        ("{}", "'do'"),
        ('{"id": 1, "do": "quit"}', "quit"),
        ('{"id": 1, "do": "step", "much": 2}', "much"),
        ('{"id": -1, "do": "step"}', "id"),
        ('{"id": true, "do": "step"}', "id"),
        ('{"do": "step"}', "id"),
        ('{"id": 1, "do": "pause", "paused": 1}', "paused"),
        ('{"id": 1, "do": "set_speed", "speed": 1e300}', "speed"),
        ('{"id": 1, "do": "set_speed", "speed": NaN}', "speed"),
        ('{"id": 1, "do": "set_goal", "agents": [], "goal": [1, 1]}', "agents"),
        ('{"id": 1, "do": "set_goal", "agents": [1.5], "goal": [1, 1]}', "agents"),
        ('{"id": 1, "do": "set_goal", "agents": [1], "goal": [Infinity, 1]}', "goal"),
        ('{"id": 1, "do": "set_goal", "agents": [1], "goal": [1]}', "goal"),
        ('{"id": 1, "do": "set_goal", "agents": [1], "goal": [1, 2], "on_arrival": "fly"}', "on_arrival"),
        ('{"id": 1, "do": "add", "group": "a", "count": 100000}', "count"),
        ('{"id": 1, "do": "remove_obstacle", "name": ""}', "name"),
        (b'{"id": 1, "do": "step"}', "not bytes"),
    ],
)
def test_what_is_no_request_is_refused_in_words(message, said):
    with pytest.raises(RequestRefused) as refused:
        read_request(message)
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


def test_walls_have_a_length():
    for length, fits in ((0.1, False), (0.3, True), (150, True), (250, False)):
        wall = DrawWall(id=1, do="draw_wall", points=((0.0, 0.0), (0.0, float(length))))
        if fits:
            wall.require_length()
        else:
            with pytest.raises(RequestRefused, match="long"):
                wall.require_length()


def test_malformed_requests_keep_their_number():
    assert number_of('{"id": 12, "do": "nothing"}') == 12
    assert number_of(b'{"id": 12}') == 12
    for message in ("", "12", '{"id": "12"}', '{"id": -1}', b"\xff\xfe"):
        assert number_of(message) is None
