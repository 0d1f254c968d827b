"""Plans: ranks of those who let others go first, and searches that find no motion."""

from crowdsim.crowd.captured_crowd import CapturedCrowd
from crowdsim.crowd.search.plans import NO_MOTION, Found
from crowdsim.crowd.systems.replan import reach_goal
from crowdsim.scenario.loader import parse_scenario

PAIR = """\
crowdsim: 1
name: pair
seed: 1
duration: 60
floor: {rectangle: [0, 0, 9, 4]}
agents:
  - name: a
    count: 2
    locomotion: captured
    start: {rectangle: [0.5, 0.5, 2, 3.5]}
    goals: [{point: [5, 1]}, {point: [8, 3]}]
    wait: 60
"""


def test_searches_in_vain_count_until_one_finds_motion_or_no_path_or_the_goal_is_another() -> None:
    crowd = CapturedCrowd(parse_scenario(PAIR), 1, None)
    for _ in range(30):
        crowd.advance()
        crowd.begin_work()
        crowd.end_step()
    plans, view = crowd.plans, crowd.world.view()
    agent, found = int(view.agent[0]), plans.motions[int(view.agent[0])]
    vain = Found(agent, None, None, None, over=True, outdated=False)

    def search_in_vain() -> None:
        for _ in range(NO_MOTION):
            assert not plans.is_stuck(agent)
            plans.note_motion(vain._replace(over=False))  # it goes on
            plans.note_motion(vain._replace(outdated=True))  # another search may succeed
            plans.note_motion(vain)
        assert plans.is_stuck(agent)

    search_in_vain()
    plans.note_motion(vain._replace(plan=found))
    search_in_vain()
    plans.unreachable[agent] = "no path"
    plans.note_motion(vain)
    del plans.unreachable[agent]
    search_in_vain()
    reach_goal(plans, view, 0)
    search_in_vain()
    plans.forget(agent)
    assert not plans.is_stuck(agent)
    crowd.close()


def test_those_who_let_all_others_go_first_rank_behind_those_who_set_out_then_but_before_later_ones() -> None:
    crowd = CapturedCrowd(parse_scenario(PAIR), 1, None)
    plans = crowd.plans
    for step in (0, 7):
        plans.step = step
        ranks = [*(plans.rank(agent) for agent in range(2)), *(plans.rank_behind_all(place) for place in range(2))]
        plans.step = step + 1
        ranks.append(plans.rank(0))
        assert ranks == sorted(set(ranks))
    crowd.close()
