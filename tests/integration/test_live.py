"""Live simulations in a real browser: clicks, drags, pause and a lost connection; and how the command ends."""

import os
import re
import signal
import subprocess
import sys

import numpy as np
import pytest

from crowdsim import Recording, Simulation, load_scenario
from crowdsim.cli.errors_shown import INTERRUPTED, TERMINATED
from crowdsim.scenario.loader import parse_scenario
from tests.support.browser import Visit, chromium
from tests.support.live import living
from tests.unit.live.test_session import HALL, hall

SCREEN = """([x, y, z]) => {
    const { player } = crowdsim, v = player.cameras.camera.position.clone();
    const box = player.canvas.getBoundingClientRect();
    player.cameras.camera.updateMatrixWorld();
    v.set(x, y, z).project(player.cameras.camera);
    return [box.left + 0.5 * (v.x + 1) * box.width, box.top + 0.5 * (1 - v.y) * box.height];
}"""


@pytest.fixture(scope="module")
def browser():
    with chromium() as opened:
        yield opened


STANDS = """!crowdsim.player.playing
    && crowdsim.player.time === crowdsim.player.source.latest / crowdsim.player.source.rate"""
"""Whether the page shows the last step of a simulation that stands."""


class LiveVisit(Visit):
    """A live page, driven with the mouse."""

    def pixel(self, *place):
        return self.ask(SCREEN, list(place))

    def click(self, *place):
        self.page.mouse.click(*self.pixel(*place))

    def drag(self, start, end):
        self.page.mouse.move(*self.pixel(*start))
        self.page.mouse.down()
        for share in (0.3, 0.7, 1.0):
            self.page.mouse.move(*self.pixel(*(a + share * (b - a) for a, b in zip(start, end, strict=True))))
        self.page.mouse.up()

    def answer(self):
        return self.page.locator("#answer").inner_text()


@pytest.fixture
def live_page(browser, tmp_path):
    """``live_page(scenario)`` runs it and gives the live simulation and its page, which is ready."""
    opened = []

    def of(scenario, speed=1.0):
        context = living(scenario, tmp_path / "run.h5", speed, page=True)
        live = context.__enter__()
        opened.append(context)
        visit = LiveVisit(browser, live.told.server.address, viewport={"width": 1100, "height": 700})
        opened.append(visit)
        return live, visit.ready()

    yield of
    for each in reversed(opened):
        if isinstance(each, Visit):
            each.page.close()
        else:
            each.__exit__(None, None, None)


def commands_of(live):
    return [command.action for command in live.simulation.commands]


def select_someone(visit):
    """Pause, click an agent, and return its number."""
    visit.wait("crowdsim.player.frame.state.some(state => state > 0)")
    visit.page.keyboard.press(" ")
    visit.wait(STANDS)
    visit.page.wait_for_timeout(100)
    agent = visit.ask("crowdsim.player.frame.state.findIndex(state => state > 0)")
    visit.click(*visit.ask("a => [crowdsim.player.frame.x[a], crowdsim.player.frame.y[a], 1]", agent))
    assert visit.ask("crowdsim.player.selected") == agent
    return agent


def test_a_click_on_a_character_and_one_on_the_floor_send_it_there(live_page):
    live, visit = live_page(hall())
    agent = select_someone(visit)
    assert live.told.states[-1]["paused"]
    visit.click(8.0, 3.0, 0.0)
    visit.wait("document.getElementById('answer').textContent.includes('goes to')")
    (command,) = live.simulation.commands
    assert command.set_goal.agents == (agent,)
    # A click is a place to a pixel: some centimeters in this picture.
    goal = visit.ask("a => crowdsim.player.facts.goals[a]", agent)
    assert np.allclose(goal, (8.0, 3.0), atol=0.05)
    assert command.at == live.simulation.time
    visit.page.keyboard.press(" ")
    live.wait(lambda: agent not in live.simulation.agents.present)
    assert live.simulation.step_count < 60 * live.simulation.scenario.steps_per_second
    # Out of the world: a further click sends nobody.
    visit.click(8.0, 3.0, 0.0)
    assert commands_of(live) == ["set_goal"]
    assert visit.complained == []


def test_a_click_beside_the_floor_is_refused_in_words(live_page):
    live, visit = live_page(hall())
    select_someone(visit)
    visit.click(6.0, -0.5, 0.0)
    visit.wait("document.getElementById('answer').classList.contains('refused')")
    assert "floor" in visit.answer()
    assert commands_of(live) == []


def test_things_are_dragged_and_walls_drawn(live_page):
    live, visit = live_page(hall())
    before = visit.ask("crowdsim.player.cameras.camera.position.toArray()")
    visit.drag((6.0, 1.5, 0.45), (6.0, 5.0, 0.45))
    visit.wait("document.getElementById('answer').textContent === 'Cart is moved'")
    live.wait(lambda: np.mean(live.told.thing("cart")["outline"][:-1], axis=0)[1] > 3.5)
    assert np.allclose(visit.ask("crowdsim.player.cameras.camera.position.toArray()"), before)
    visit.page.get_by_label("draws a wall").check()
    visit.drag((3.0, 0.5, 0.0), (3.0, 2.0, 0.0))
    visit.wait("document.getElementById('things').textContent.includes('drawn wall 1')")
    outline = np.array(live.told.thing("drawn wall 1")["outline"])
    assert np.allclose([outline[:, 1].min(), outline[:, 1].max()], [0.5, 2.0], atol=0.1)
    # Away from things a drag turns the picture.
    visit.page.get_by_label("sends the selected").check()
    visit.drag((10.0, 6.0, 0.0), (11.0, 6.0, 0.0))
    assert not np.allclose(visit.ask("crowdsim.player.cameras.camera.position.toArray()"), before)
    assert commands_of(live) == ["move", "insert"]
    assert visit.complained == []


def test_doors_people_and_obstacles_by_buttons(live_page):
    live, visit = live_page(hall())
    page = visit.page
    page.get_by_role("button", name="Close gate").click()
    page.get_by_role("button", name="Open gate").wait_for()
    assert live.told.thing("gate")["there"]
    page.get_by_role("button", name="Remove cart").click()
    live.wait(lambda: not live.told.thing("cart")["there"])
    page.get_by_label("adds people").check()
    page.get_by_label("How many").fill("2")
    page.get_by_role("button", name="At its start").click()
    visit.wait("document.getElementById('group').textContent.includes('2 left')")
    page.get_by_label("How many").fill("1")
    visit.click(5.0, 5.0, 0.0)
    visit.wait("document.getElementById('group').textContent.includes('1 left')")
    guests = {agent for agent in range(live.simulation.crowd.count) if live.simulation.agents.groups[agent] == "guests"}
    live.wait(lambda: len(guests & set(live.simulation.agents.present.tolist())) == 3)
    assert commands_of(live) == ["close", "remove", "add", "add"]
    assert visit.complained == []


def test_a_scenario_to_which_nobody_can_be_added_says_what_it_lacks(live_page):
    text = HALL.format(locomotion="captured", duration=60, rounds=9).replace("on_call: true, ", "")
    _, visit = live_page(parse_scenario(text))
    visit.page.get_by_label("adds people").check()
    assert "on_call: true" in visit.page.locator("#none-on-call").inner_text()


def test_pause_and_steps(live_page):
    live, visit = live_page(hall())
    visit.wait("crowdsim.player.source.latest > 5")
    visit.page.locator("#play").click()
    visit.wait("!crowdsim.player.playing")
    stood = live.simulation.step_count
    visit.page.get_by_role("button", name="One step").click()
    visit.wait(f"crowdsim.player.source.latest === {stood}")
    visit.page.keyboard.press(".")
    visit.wait(f"crowdsim.player.source.latest === {stood + 1}")
    assert live.simulation.step_count == stood + 2
    visit.page.locator("#speed").select_option("2")
    live.wait(lambda: live.told.states[-1]["speed"] == 2.0)
    visit.page.locator("#play").click()
    live.wait(lambda: live.simulation.step_count > stood + 10)


def test_a_page_that_lost_its_connection_goes_on(live_page):
    live, visit = live_page(hall())
    select_someone(visit)
    visit.page.keyboard.press(" ")
    # Wait for the answer: a request that is under way when the connection breaks is lost with it.
    visit.wait("crowdsim.player.playing")
    visit.ask("crowdsim.player.connection.socket.close()")
    visit.wait("document.getElementById('link').classList.contains('lost')")
    assert "Trying again" in visit.page.locator("#link").inner_text()
    visit.wait("crowdsim.player.connection.opened === 2")
    seen = visit.ask("crowdsim.player.source.latest")
    visit.wait(f"crowdsim.player.source.latest > {seen} + 5 && crowdsim.player.playing")
    assert visit.page.locator("#link").inner_text() == "Running"
    assert visit.ask("crowdsim.player.selected") >= 0
    visit.page.keyboard.press(" ")
    live.wait(lambda: live.told.states[-1]["paused"])


@pytest.mark.parametrize("locomotion", ["captured", "auto", "steered"])
def test_the_page_shows_people_where_they_are(live_page, locomotion, tmp_path):
    live, visit = live_page(hall(locomotion))
    visit.wait("crowdsim.player.source.latest > 40")
    visit.page.keyboard.press(" ")
    visit.wait(STANDS)
    rows = visit.ask("crowdsim.at(crowdsim.player.time)")
    agents = live.simulation.agents
    assert [row["agent"] for row in rows] == agents.present.tolist()
    for row in rows:
        assert abs(row["x"] - agents.x[row["agent"]]) < 1e-4
        assert abs(row["y"] - agents.y[row["agent"]]) < 1e-4
        joints = np.reshape(row["joints"], (-1, 3))
        # A body stands on the floor, upright, where its track is.
        assert -0.05 < joints[:, 2].min() < 0.15
        assert 1.3 < joints[:, 2].max() < 2.1
        assert np.hypot(*(joints[0, :2] - [row["x"], row["y"]])) < 0.35
    assert visit.complained == []
    # A busy machine may drop pictures, which are counted; how many is a matter of its speed.
    assert 0 <= visit.ask("crowdsim.player.source.lost") < visit.ask("crowdsim.player.source.latest")


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, INTERRUPTED), (signal.SIGTERM, TERMINATED)])
def test_the_command_ends_cleanly_and_leaves_what_can_be_run_again(number, code, tmp_path, environment):
    hall().save(tmp_path / "hall.yaml")
    command = [sys.executable, "-m", "crowdsim", "serve", "hall.yaml", "--port", "0", "--record", "run.h5"]
    started = subprocess.Popen(
        command, cwd=tmp_path, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        address = started.stdout.readline()
        assert re.fullmatch(r"http://127\.0\.0\.1:\d+/\?token=\S{24}\n", address), address + started.stderr.read()
        while not (tmp_path / "run.h5.part").exists():
            assert started.poll() is None
        os.kill(started.pid, number)
        _, said = started.communicate(timeout=60)
    finally:
        started.kill()
    assert started.returncode == code, said
    assert "run.h5 and run.yaml" in said
    assert "Traceback" not in said
    with Recording.open(tmp_path / "run.h5") as recording, Simulation(load_scenario(tmp_path / "run.yaml")) as again:
        assert recording.complete
        for wanted in recording.state_hash[:]:
            again.step()
            assert again.state_hash == wanted
