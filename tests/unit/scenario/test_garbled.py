"""Loading garbled text: nothing but scenario errors, with their lines."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from crowdsim.errors import Problem, ScenarioError
from crowdsim.scenario.loader import parse_scenario
from tests.unit.scenario.sample import TEXT


def outcome(text: str) -> list[Problem] | None:
    """Problems of the text, None if it is a scenario; any other error gets out."""
    try:
        parse_scenario(text)
    except ScenarioError as error:
        return error.problems
    return None


_NOISE = st.sampled_from(
    ["\t", "\n", "- ", "? ", ": ", "{", "}", "[", "]", ",", "&a ", "*a", "!x ", "'", '"', "#", "\x00", "é", ".inf", "-"]
    + ["1e999", "9" * 500, "~", "true", "<<: ", "\r", "\ufeff", "[" * 50, "0", "rectangle: [0, 0, 1, 1]", "name: x\n"]
)


@settings(max_examples=50, deadline=None, derandomize=True)
@given(st.lists(st.tuples(st.integers(0, len(TEXT)), _NOISE, st.integers(0, 8)), min_size=1, max_size=3))
def test_a_garbled_scenario_raises_nothing_but_scenario_errors(edits):
    text = TEXT
    for position, noise, removed in edits:
        text = text[:position] + noise + text[position + removed :]
    problems = outcome(text)
    assert problems != []
    for problem in problems or ():
        str(problem).encode()
        assert problem.line is not None


@settings(max_examples=50, deadline=None, derandomize=True)
@given(st.text(max_size=60))
def test_garbage_is_never_a_scenario(text):
    with pytest.raises(ScenarioError):
        parse_scenario(text)
