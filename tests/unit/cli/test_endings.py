"""How commands end that are told to, or that have nobody to move."""

import os
import signal

import pytest

from crowdsim.cli.errors_shown import TERMINATED, Terminated, describe
from crowdsim.cli.progress import RunProgress
from crowdsim.cli.summary import nobody_arrived

SUMMARY = {"characters": 3, "arrived": 0, "waiting": 0, "unreachable": {}, "laps": {}, "lowest_foot": 0.0, "steps": 20}


def test_termination_has_its_own_code_and_is_an_interruption():
    assert describe(Terminated()) == ("terminated", TERMINATED)
    assert TERMINATED == 128 + signal.SIGTERM
    assert issubclass(Terminated, KeyboardInterrupt)


def test_a_run_that_is_terminated_ends_after_its_step():
    usual = signal.getsignal(signal.SIGTERM)
    signal.signal(signal.SIGTERM, lambda number, frame: None)
    try:
        with RunProgress("run") as progress:
            progress.begin_steps()
            progress.step(1, 10, None)
            os.kill(os.getpid(), signal.SIGTERM)
            with pytest.raises(Terminated):
                progress.step(2, 10, None)
        assert progress.steps_done == 1
    finally:
        signal.signal(signal.SIGTERM, usual)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"unreachable": {0: "no passage", 1: "no passage", 2: "no passage"}}, "no way for 3 of 3"),
        ({"unreachable": {0: "no passage"}, "waiting": 2}, "no way for 1 of 3 characters, 2 still waited"),
        ({"lowest_foot": None}, "no character came in within 20 steps"),
    ],
)
def test_where_nobody_could_arrive_it_is_said_why(change, reason):
    assert reason in str(nobody_arrived(SUMMARY | change))
    assert nobody_arrived(SUMMARY | change | {"arrived": 1}) is None


def test_who_is_on_the_way_is_no_failure():
    assert nobody_arrived(SUMMARY) is None
    assert nobody_arrived(SUMMARY | {"lowest_foot": None, "laps": {"round": 2}}) is None
