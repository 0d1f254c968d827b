"""Pages of a part of a run that begins or ends while somebody changes between captured and steered motion."""

import numpy as np
import pytest

from crowdsim.export.page.page import PageOptions, write_page
from crowdsim.recording.reader import Recording

BODIES = "time => crowdsim.at(time).map((body) => body.joints.every(Number.isFinite))"


def parts_within_switches(recording):
    """Windows (agent, first, last step) that end or begin within a switch, some of which are shown in their step."""
    found = []
    switches = recording.switches
    for steered in (True, False):
        low, high = (switches.shown, switches.steps) if steered else (switches.steps, switches.shown)
        slow = np.flatnonzero((switches.steered == steered) & (high > low))[:2]
        at_once = np.flatnonzero((switches.steered == steered) & (high == low))[:2]
        for number in [*slow, *at_once]:
            agent, middle = int(switches.agents[number]), int(low[number] + high[number]) // 2
            found += [(agent, max(middle - 40, 0), middle), (agent, middle, min(middle + 40, recording.steps - 1))]
    return found


def test_a_page_that_is_cut_within_a_switch_shows_everybody(visit, recorded, tmp_path):
    with Recording.open(recorded("plaza")) as recording:
        rate = recording.steps_per_second
        windows = parts_within_switches(recording)
        assert len(windows) >= 8
        for number, (agent, first, last) in enumerate(windows):
            file = tmp_path / f"{number}.html"
            write_page(recording, file, PageOptions(start=first / rate, end=last / rate, agents=str(agent)))
            shown = visit(file)
            for step in {first, first + 1, (first + last) // 2, last - 1, last}:
                assert all(shown.ask(BODIES, step / rate)), (agent, first, last, step)
            assert shown.complained == []


@pytest.mark.parametrize("shown_at_once", [True, False])
def test_a_page_whose_last_step_is_the_first_captured_one(recorded, visit, tmp_path, shown_at_once):
    with Recording.open(recorded("plaza")) as recording:
        switches, rate = recording.switches, recording.steps_per_second
        some = np.flatnonzero(~switches.steered & ((switches.shown == switches.steps) == shown_at_once))
        for number in some[:2].tolist():
            agent, last = int(switches.agents[number]), int(switches.shown[number])
            for first in (last - 1, max(last - 30, 0)):
                file = tmp_path / f"{number}-{first}.html"
                write_page(recording, file, PageOptions(start=first / rate, end=last / rate, agents=str(agent)))
                page = visit(file)
                assert all(page.ask(BODIES, last / rate))
                assert page.complained == []
