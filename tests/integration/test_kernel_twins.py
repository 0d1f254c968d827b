"""Every kernel is compared with something slow and obvious, or stands here with the reason why not.

A twin counts if a test imports both, the kernels and a module of ``tests/reference``. What is compared otherwise is
listed below, and the lists are held to be true: once the missing twin is written, its line must be taken out.

First by file, then for each kernel that Python calls: a test that compares its file names it, or names the function
above it that is listed in FRONTS, or it is part of a kernel that is compared.
"""

import ast
from pathlib import Path

import pytest

from tests.integration.test_house_rules import imported_modules

ROOT = Path(__file__).parents[2]

THROUGH_ITS_FRONT = {
    "crowd.systems.reserving_kernels": ("tests/unit/crowd/systems/test_going_on.py", "going_on"),
    "following.follower.branch_kernels": ("tests/unit/following/follower/test_path_follower.py", "follow_maps"),
    "following.follower.candidate_kernels": ("tests/unit/following/follower/test_path_follower.py", "follow_maps"),
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
    "geometry.cell_kernels": ("tests/unit/geometry/test_cells.py", "lists by cells, made in one pass"),
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
    "agents that follow them arrive, is a property test",
    "planning.roadmap.polishing_kernels.shift_path": "its stages have twins (choose_shifts, gates); as a whole it only "
    "takes what is cheaper, and a property test holds that plans stay sound",
    "planning.roadmap.search_kernels.find_road": "its cost is an estimate; plans are held to fast marching "
    "(tests/integration/test_plans_beside_reference.py), costs_from and the landmarks have twins",
}
"""Files of kernels, and single kernels, without a twin, and why."""


FRONTS = {
    "following.follower.follow_kernels.follow": (
        "following.follower.path_follower:follow_path",
        "tests/unit/following/follower/test_path_follower.py",
    ),
    "following.graph_search.channel_kernels.draw_channel": (
        "following.graph_search.channel:make_channel",
        "tests/unit/following/graph_search/test_graph_search.py",
    ),
    "following.graph_search.graph_search_kernels.search": (
        "following.graph_search.graph_search:search_graph",
        "tests/unit/following/graph_search/test_graph_search.py",
    ),
    "following.maps.map_kernels.grow_maps": (
        "following.maps.motion_maps:MotionMaps",
        "tests/unit/following/maps/test_motion_maps.py",
    ),
    "geometry.elementary_kernels.evaluate": (
        "geometry.elementary:sin",
        "tests/unit/geometry/test_elementary.py",
    ),
    "motion.planted.follow_kernels.follow_feet": (
        "motion.planted.follow_feet:FollowedFeet",
        "tests/unit/motion/planted/test_pinned_feet.py",
    ),
    "navmesh.clearance.clearance_kernels.clearances": (
        "navmesh.queries:clearances",
        "tests/unit/navmesh/clearance/test_clearance.py",
    ),
    "planning.labels.labelling_kernels.label_stretches": (
        "planning.labels.labelling:label_path",
        "tests/unit/planning/labels/test_labelling.py",
    ),
    "planning.margins.turn_kernels.bend_turns": (
        "planning.margins.turns:with_turn_room",
        "tests/unit/planning/margins/test_turns.py",
    ),
    "steering.commit_kernels.commit_rows": ("steering.steering:Steering", "tests/unit/steering/test_commit.py"),
    "steering.guidance.crowding_kernels.change_where_it_pays": (
        "steering.guidance.guidance:Guidance",
        "tests/unit/steering/guidance/test_crowding.py",
    ),
    **{
        f"steering.guidance.pocket_kernels.{name}": (
            "steering.guidance.ways_out:WaysOutOfPockets",
            "tests/unit/steering/guidance/test_pockets.py",
        )
        for name in ("find_pocket", "write_ways_out")
    },
    "steering.guidance.solve_kernels.solve": (
        "steering.guidance.field:solve_field",
        "tests/unit/steering/guidance/test_field.py",
    ),
    "steering.guidance.way_kernels.sample": (
        "steering.guidance.field:guide",
        "tests/unit/steering/guidance/test_field.py",
    ),
    "steering.guidance.way_kernels.ways_at": (
        "steering.guidance.field:ways",
        "tests/unit/steering/guidance/test_field.py",
    ),
    "steering.way_kernels.clear_of_ways": ("steering.ways:clear_of", "tests/unit/steering/test_ways.py"),
    **{
        f"motion.deformed.plan_kernels.{name}": (
            "motion.deformed.step_plan:plan_steps",
            "tests/unit/motion/deformed/test_slow_twins.py",
        )
        for name in ("fill_samples", "plan_prints", "plan_drops", "plan_swings")
    },
    **{
        f"steering.guidance.{name}": (
            "steering.guidance.ground:build_ground",
            "tests/unit/steering/guidance/test_ground.py",
        )
        for name in (
            "ground_kernels.list_segments",
            "ground_kernels.bound_distances",
            "pin_kernels.set_pins",
            "pin_kernels.mend_pins",
            "pin_kernels.set_ways",
        )
    },
    **{
        f"steering.wall_kernels.{name}": ("steering.walls:build_walls", "tests/unit/steering/test_look.py")
        for name in ("list_walls", "measure_distances")
    },
}
"""Kernels that no comparing test names: the function above them that one names, and that test."""


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


def test_no_list_holds_what_is_compared_or_gone(kernels, compared, functions):
    listed = [*THROUGH_ITS_FRONT, *IN_THE_TEST, *WITHOUT]
    assert len(listed) == len(set(listed))
    assert sorted(set(listed) - set(kernels) - set(functions)) == []
    assert sorted(set(listed) & compared) == [], "these have a twin now: take them out of the lists"


@pytest.mark.parametrize("kernel", sorted(THROUGH_ITS_FRONT))
def test_a_test_of_the_front_imports_the_twin(kernel):
    test, twin = THROUGH_ITS_FRONT[kernel]
    assert f"tests.reference.{twin}" in modules_of(ROOT / test)


@pytest.mark.parametrize("kernel", sorted(IN_THE_TEST))
def test_a_test_with_its_own_twin_imports_the_kernel(kernel):
    assert f"crowdsim.{kernel}" in modules_of(ROOT / IN_THE_TEST[kernel][0])


def names_in(tree: ast.AST) -> set[str]:
    """Identifiers, attributes and imported names in a piece of code."""
    found: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Name):
            found.add(node.id)
        elif isinstance(node, ast.Attribute):
            found.add(node.attr)
        elif isinstance(node, ast.ImportFrom):
            found |= {each.name for each in node.names}
    return found


def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def imported_kernels(file: str) -> set[str]:
    """Modules of the package that a file of kernels imports."""
    modules = modules_of(ROOT / "crowdsim" / f"{file.replace('.', '/')}.py")
    return {module.removeprefix("crowdsim.") for module in modules if module.startswith("crowdsim.")}


@pytest.fixture(scope="module")
def functions(kernels) -> dict[str, ast.FunctionDef]:
    """Kernels and helpers by ``file.name``."""
    trees = {file: parsed(ROOT / "crowdsim" / f"{file.replace('.', '/')}.py") for file in kernels}
    return {
        f"{file}.{node.name}": node
        for file, tree in trees.items()
        for node in tree.body
        if isinstance(node, ast.FunctionDef)
    }


@pytest.fixture(scope="module")
def public(functions) -> set[str]:
    """Kernels that Python calls: those decorated with ``kernel``."""
    return {name for name, node in functions.items() if "kernel" in set().union(*map(names_in, node.decorator_list))}


@pytest.fixture(scope="module")
def comparing() -> list[tuple[set[str], set[str]]]:
    """Modules and names of each test that compares: with a twin of ``tests/reference``, or with its own."""
    own = {ROOT / test for test, _ in IN_THE_TEST.values()}
    paths = [path for path in (ROOT / "tests").rglob("test_*.py") if path != Path(__file__)]
    tests = [(path, modules_of(path), names_in(parsed(path))) for path in paths]
    return [
        (modules, names)
        for path, modules, names in tests
        if path in own or any(module.startswith("tests.reference") for module in modules)
    ]


def test_each_kernel_is_named_by_a_test_that_compares_it(functions, public, comparing):
    def is_named(kernel: str) -> bool:
        file, _, name = kernel.rpartition(".")
        return any(name in names and f"crowdsim.{file}" in modules for modules, names in comparing)

    reached = {kernel for kernel in public if kernel in FRONTS or is_named(kernel)}
    assert sorted(kernel for kernel in FRONTS if is_named(kernel)) == [], "these are named: take them out of FRONTS"
    # What a compared kernel calls is compared with it.
    seen = {file: {*imported_kernels(file), file} for file in {kernel.rpartition(".")[0] for kernel in functions}}
    waiting = list(reached)
    while waiting:
        kernel = waiting.pop()
        names = names_in(functions[kernel])
        called = {f"{file}.{name}" for file in seen[kernel.rpartition(".")[0]] for name in names} & functions.keys()
        waiting += called - reached
        reached |= called
    missing = sorted(kernel for kernel in public - reached if not {kernel, kernel.rpartition(".")[0]} & WITHOUT.keys())
    assert sorted(WITHOUT.keys() & reached) == [], "these are compared: take them out of WITHOUT"
    assert not missing, f"no comparing test names these, nor a function above them: {', '.join(missing)}"


@pytest.mark.parametrize("kernel", sorted(FRONTS))
def test_the_front_calls_the_kernel_and_the_test_names_the_front(kernel, comparing):
    front, test = FRONTS[kernel]
    module, _, name = front.partition(":")
    assert kernel.rpartition(".")[2] in names_in(parsed(ROOT / "crowdsim" / f"{module.replace('.', '/')}.py"))
    assert name in names_in(parsed(ROOT / test))
    assert (modules_of(ROOT / test), names_in(parsed(ROOT / test))) in comparing


def test_the_reasons_say_something():
    assert all(len(reason.split()) >= 8 for reason in WITHOUT.values())
