"""A complete search for motion."""

from crowdsim.crowd.search.motion_search import MotionSearch
from crowdsim.crowd.state.assets import Assets
from crowdsim.crowd.state.environment import EnvironmentState
from crowdsim.crowd.state.motion_plan import MotionPlan, Request
from crowdsim.errors import PathNotFound


def search_motion(assets: Assets, environment: EnvironmentState, request: Request) -> MotionPlan | PathNotFound:
    """Run all slices of a search one after another, before anything is walked."""
    search = MotionSearch(assets, environment, request)
    plan = search.advance()
    while not search.over:
        plan = search.advance()
    return plan
