"""Every file of kernels is compared with something slow and obvious, or stands here with the reason why not.

A twin counts if a test imports both, the kernels and a module of ``tests/reference``. What is compared otherwise is
listed below, and the lists are held to be true: whoever writes the missing twin must take its line out.
"""

import ast
from pathlib import Path

import pytest

from tests.integration.test_house_rules import imported_modules

ROOT = Path(__file__).parents[2]

THROUGH_ITS_FRONT = {
    "following.follower.branch_kernels": ("tests/unit/following/follower/test_path_follower.py", "follow_maps"),
    "following.follower.follow_kernels": ("tests/unit/following/follower/test_path_follower.py", "follow_maps"),
    "following.maps.map_kernels": ("tests/unit/following/maps/test_motion_maps.py", "follow_maps"),
    "navmesh.shortest.complete_search_kernels": (
        "tests/unit/navmesh/shortest/test_shortest_paths.py",
        "shortest_reference",
    ),
    "navmesh.shortest.end_kernels": ("tests/unit/navmesh/shortest/test_shortest_paths.py", "shortest_reference"),
    "navmesh.shortest.tangent_search_kernels": (
        "tests/unit/navmesh/shortest/test_shortest_paths.py",
        "shortest_reference",
    ),
    "navmesh.clearance.clearance_kernels": ("tests/property/test_query_properties.py", "navmesh_reference"),
    "navmesh.paths.search_kernels": ("tests/unit/navmesh/paths/test_ways.py", "way_reference"),
    "planning.labels.fitting_kernels": ("tests/property/test_planner_properties.py", "plan_roadmap"),
}
"""Kernels that Python reaches by a function above them: the test that compares it, and the twin that it imports."""

IN_THE_TEST = {
    "crowd.report.measure_kernels": ("tests/unit/crowd/report/test_measures.py", "all pairs; shapely"),
    "crowd.state.digest_kernels": ("tests/unit/crowd/state/test_digest.py", "plain integers of Python"),
    "following.follower.path_kernels": ("tests/property/test_projection_properties.py", "every piece of the path"),
    "geometry.elementary_kernels": ("tests/unit/geometry/test_elementary.py", "mpmath with fifty digits"),
    "geometry.planar_kernels": ("tests/unit/geometry/test_planar.py", "one is the inverse of the other"),
    "geometry.segments_kernels": ("tests/unit/geometry/test_segments.py", "shapely"),
    "motion.deformed.spline_kernels": ("tests/unit/motion/deformed/test_splines.py", "scipy"),
    "planning.baselines.greedy_kernels": ("tests/unit/planning/baselines/test_greedy.py", "the same step by step"),
    "planning.roadmap.gate_kernels": ("tests/unit/planning/roadmap/test_polishing.py", "shapely"),
    "planning.roadmap.shifting_kernels": ("tests/unit/planning/roadmap/test_polishing.py", "all shifts there are"),
    "planning.single_behavior_kernels": ("tests/unit/planning/test_single_behavior.py", "two calls instead of one"),
}
"""Kernels whose twin is short, or a library: the test that has it, and what it is."""

WITHOUT = {
    "planning.roadmap.build_kernels": "where points are placed is a choice, not an answer; plans are held to fast "
    "marching (tests/integration/test_plans_beside_reference.py), points and ways to places whose answer is plain",
    "planning.roadmap.funnel_kernels": "a string beside single corners is plain; whole strings are checked by the mesh "
    "itself when they become paths",
    "planning.roadmap.measuring_kernels": "measured at places whose answer is plain; labels of paths are exact",
    "steering.guidance.ask_kernels": "what the next meters ask for is a rule; it is tested at gaps and at open walls",
    "steering.guidance.pin_kernels": "where a pin lies is a choice; that fields over pins are consistent, and that "
    "whoever follows them arrives, is a property test",
}
"""Kernels without a twin, and why."""


def modules_of(path: Path) -> set[str]:
    return set(imported_modules(ast.parse(path.read_text(encoding="utf-8"))))


@pytest.fixture(scope="module")
def kernels() -> list[str]:
    files = sorted((ROOT / "crowdsim").rglob("*_kernels.py"))
    return [".".join(file.relative_to(ROOT / "crowdsim").with_suffix("").parts) for file in files]


@pytest.fixture(scope="module")
def compared(kernels) -> set[str]:
    """Kernel files that some test imports together with a slow twin."""
    found = set()
    for path in (ROOT / "tests").rglob("test_*.py"):
        modules = modules_of(path)
        if any(module.startswith("tests.reference.") for module in modules):
            found |= {kernel for kernel in kernels if f"crowdsim.{kernel}" in modules}
    return found


def test_every_kernel_has_its_slow_twin_or_a_reason(kernels, compared):
    listed = {*THROUGH_ITS_FRONT, *IN_THE_TEST, *WITHOUT}
    missing = sorted(set(kernels) - compared - listed)
    assert not missing, f"write a twin in tests/reference and a test that imports both: {', '.join(missing)}"


def test_no_list_holds_what_is_compared_or_gone(kernels, compared):
    listed = [*THROUGH_ITS_FRONT, *IN_THE_TEST, *WITHOUT]
    assert len(listed) == len(set(listed))
    assert sorted(set(listed) - set(kernels)) == []
    assert sorted(set(listed) & compared) == [], "these have a twin now: take them out of the lists"


@pytest.mark.parametrize("kernel", sorted(THROUGH_ITS_FRONT))
def test_a_test_of_the_front_imports_the_twin(kernel):
    test, twin = THROUGH_ITS_FRONT[kernel]
    assert f"tests.reference.{twin}" in modules_of(ROOT / test)


@pytest.mark.parametrize("kernel", sorted(IN_THE_TEST))
def test_a_test_with_its_own_twin_imports_the_kernel(kernel):
    assert f"crowdsim.{kernel}" in modules_of(ROOT / IN_THE_TEST[kernel][0])


def test_the_reasons_say_something():
    assert all(len(reason.split()) >= 8 for reason in WITHOUT.values())
