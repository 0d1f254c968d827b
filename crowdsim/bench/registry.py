"""The benchmarks by name, and the form of their results."""

from __future__ import annotations

import importlib
import inspect
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from crowdsim.bench.machine import describe_machine, describe_versions, load_average
from crowdsim.errors import CrowdSimError

_BENCHES = {
    "startup": ("crowdsim.bench.startup", "seconds until something happens: help, import, kernels, first step"),
    "navmesh": (
        "crowdsim.bench.places.navmesh",
        "navigation meshes: build, paths, clearances and edits; lengths, violations",
    ),
    "environment": (
        "crowdsim.bench.places.environment",
        "3D worlds: time to layers and meshes, fit to a laser map, free area",
    ),
    "planner": (
        "crowdsim.bench.plans.planner",
        "plans: time, cost and proven gap of each planner, 5 to 20 steps in clutter",
    ),
    "plan-soundness": (
        "crowdsim.bench.plans.plan_soundness",
        "plans: clearance kept along their sections, and how deep bodies posed along them in 3D reach into obstacles",
    ),
    "motion-graph": (
        "crowdsim.bench.motions.motion_graph",
        "motion graphs: standard against feature-based, time, size and branching as the set grows",
    ),
    "planted-feet": (
        "crowdsim.bench.motions.planted_feet",
        "planted feet of captured bodies as shown: drift by stance beside that of the clips, time of posing",
    ),
    "motion-search": (
        "crowdsim.bench.motions.motion_search",
        "A* on the motion graph: collision tests against channels, with and without branch kinematics",
    ),
    "crowd": (
        "crowdsim.bench.crowds.crowd",
        "crowds: steered ones of 100 to 100,000, captured of 30 to 10,000, and mixed: a step by stage; bodies shown",
    ),
    "ranks": (
        "crowdsim.bench.crowds.ranks",
        "a steered run on one and on two processes: time of a step, exchange, and what it predicts for more",
    ),
    "studies": (
        "crowdsim.bench.studies",
        "points a minute of a sweep beside calls of run; a sweep that is killed ten times ends with the same table",
    ),
    "drills": (
        "crowdsim.bench.crowds.drill_table",
        "steered crowds: counterflow, doors, crossings, necks, circles, endless corridors: arrivals, flow and speed",
    ),
    "hall": (
        "crowdsim.bench.mixed.hall",
        "a steered crowd between pillars, benches and boards: least gaps to people and walls in a million steps",
    ),
    "strewn-halls": (
        "crowdsim.bench.mixed.strewn",
        "halls strewn with things, crossed by thirty people each way, steered and auto: who does not arrive",
    ),
    "auto-drills": (
        "crowdsim.bench.mixed.cases",
        "the same drills walked by auto agents, beside steered ones and their bars",
    ),
    "auto-square": (
        "crowdsim.bench.mixed.square",
        "a thousand auto agents on squares: arrivals beside JuPedSim (an extra), least gaps in a million steps",
    ),
    "auto-shares": (
        "crowdsim.bench.mixed.shares",
        "built-in scenarios, seeds 1 to 5: captured share of the way, standing, time beside walking alone",
    ),
    "auto-switches": (
        "crowdsim.bench.mixed.switch_poses",
        "switches between levels as shown: jumps of joints, slip of planted feet, changes of speed, in real runs",
    ),
    "robustness": (
        "crowdsim.bench.faults.robustness",
        "random faults in scenarios, clips, recordings, caches and edits: read, refused, made anew, or failed",
    ),
    "soak": (
        "crowdsim.bench.crowds.soak",
        "an hour of a plaza with sources: how memory and the time of a step grow, who is stuck at the end",
    ),
    "page": (
        "crowdsim.bench.page",
        "pages in a browser: bytes, seconds, vertices, draw calls, milliseconds of JavaScript, errors of joints",
    ),
    "film": ("crowdsim.bench.film", "a film of a minute with 30 people: CPU seconds, pictures a second, size"),
    "export": (
        "crowdsim.bench.export",
        "exports of 100 captured agents for 60 s: size and time of each format, beside what it may take",
    ),
    "driven": (
        "crowdsim.bench.driven",
        "a step of 1,000 agents with all columns read, beside one of a run: CPU time, and what driving adds",
    ),
    "live": (
        "crowdsim.bench.live",
        "live simulations of 100 agents: late steps, and how soon a click in a page takes effect",
    ),
    "motion-maps": (
        "crowdsim.bench.motions.motion_maps",
        "motion maps: size, success and time by depth, beside A*; lengths, bodies and arrivals",
    ),
}
"""Name -> (module with a ``measure`` function, one line on what it measures)."""


@dataclass(frozen=True)
class Measurement:
    """Result of a benchmark's ``measure``.

    Attributes
    ----------
    rows : list of dict
        A table; all rows have the same keys.
    figures : dict of str to float
        The same figures by name, with units in the names, for comparing runs.
    headline : tuple of str
        Names of the figures that are shown below the table.
    """

    rows: list[dict[str, Any]]
    figures: dict[str, float]
    headline: tuple[str, ...] = ()


@dataclass(frozen=True)
class BenchResult:
    """A measurement with the machine and the versions it was made on."""

    name: str
    machine: dict[str, str | int]
    versions: dict[str, str]
    rows: list[dict[str, Any]]
    figures: dict[str, float]
    headline: tuple[str, ...]
    load: float = math.nan
    """Load average of the machine in the minute before; times taken on a busy machine are too long."""


def bench_names() -> dict[str, str]:
    """Return one line on what each benchmark measures, by name."""
    return {name: line for name, (_, line) in _BENCHES.items()}


def run_bench(
    name: str,
    maps: Path | None = None,
    worlds: Path | None = None,
    captures: Path | None = None,
    picture: Path | None = None,
    depth: dict[str, Any] | None = None,
    rvo2: Path | None = None,
    minutes: float | None = None,
) -> BenchResult:
    """Run the benchmark ``name``; options that are None are left to the benchmark, and each applies to some only.

    ``maps``, ``worlds``, ``captures`` and ``rvo2`` are folders, ``picture`` is a file to draw. ``depth`` holds size
    arguments of ``MotionMaps.build``. ``minutes`` are simulated ones [min].

    Raises
    ------
    CrowdSimError
        If there is no such benchmark, or it does not take a given option.
    """
    if name not in _BENCHES:
        raise CrowdSimError(f"there is no benchmark '{name}'; there are: {', '.join(_BENCHES)}")
    measure: Callable[..., Measurement] = importlib.import_module(_BENCHES[name][0]).measure
    options = {
        "maps": maps,
        "worlds": worlds,
        "captures": captures,
        "picture": picture,
        "depth": depth,
        "rvo2": rvo2,
        "minutes": minutes,
    }
    given = {kind: value for kind, value in options.items() if value is not None}
    for kind in given:
        if kind not in inspect.signature(measure).parameters:
            raise CrowdSimError(f"the benchmark '{name}' takes no {kind}; run it without")
    load = load_average()
    measured = measure(**given)
    return BenchResult(
        name, describe_machine(), describe_versions(), measured.rows, measured.figures, measured.headline, load
    )
