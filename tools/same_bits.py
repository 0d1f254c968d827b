"""Compare runs, plans and motion graphs under every processor that this machine can emulate.

``python tools/same_bits.py`` runs the cases below in processes that see other processors, other libraries and other
numbers of workers, and prints differing results; the exit code is 1 if there are any. ``--versions FOLDER`` also
installs the lowest and highest supported numpy and numba into environments in that folder and compares them.
``--quick`` takes a few short cases and only those variants that need no compilation, as the tests do.

One variant preloads a C library that changes every second inexact result by one unit in the last place: no run may
depend on it. It is left out, with a message, if there is no C compiler.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

SHARED = Path(os.environ.get("CROWDSIM_SHARED", ROOT.parent / "shared"))
OTHER_LIBRARY = Path(__file__).with_name("other_libm.c")

LOWEST = ("numpy==2.0.*", "numba==0.61.0")
HIGHEST = ("numpy", "numba<0.69")
BLAS_KERNELS = ("Prescott", "Haswell", "Zen", "SkylakeX")

CAPTURES = """\
crowdsim: 1
name: captures
seed: 1
duration: 40
floor: {{rectangle: [0, -2, 9, 2]}}
behaviors: [arm_constrained, frontal]
motion: {{captures: "{folder}", clips: ["16_1*.bvh", "16_31*", "16_33*", "16_47*", "16_58*"]}}
agents:
  - {{name: walkers, count: 2, start: {{point: [1, 0]}}, goal: {{point: [8, 0.5]}}, interval: 6}}
"""

SOURCE = """\
crowdsim: 1
name: source
seed: 3
duration: 60
floor: {rectangle: [0, -2, 9, 2]}
agents:
  - {name: visitors, rate: 0.4, until: 20, start: {rectangle: [0.5, -1, 1.5, 1]}, goal: {rectangle: [7.5, -1, 8.5, 1]}}
"""

HOUSE = """\
crowdsim: 1
name: house
seed: 1
duration: 60
floor: {{file: "{folder}/small_house_floor.wkt"}}
obstacles: [{{name: house, mesh: {{file: "{folder}/small_house.glb", rotation: 7}}}}]
agents:
  - {{name: guests, count: 1, start: {{point: [0, 0]}}, goal: {{point: [1, 0]}}}}
"""


def cases(quick: bool) -> dict[str, Callable[[], Any]]:
    """Return the cases: name, and a function that computes the result."""
    from tests.support import golden

    found: dict[str, Callable[[], Any]] = {
        "doorway": lambda: golden.library_figures("doorway"),
        "clutter": lambda: golden.library_figures("clutter", ["agents.0.count=3"]),
        "happy": lambda: golden.library_figures("doorway", ["motion.set=happy"]),
    }
    if quick:
        return found
    from crowdsim.scenario.loader import builtin_scenarios

    for name in sorted(builtin_scenarios()):
        found[name] = lambda name=name: golden.library_figures(name, workers=workers())
    found["dance"] = lambda: golden.library_figures("doorway", ["motion.set=dance"])
    found["source"] = lambda: golden.text_figures(SOURCE)
    found["events"] = events
    found["floor plan"] = floor_plan
    for planner in ("layered", "greedy_literal"):
        found[f"plans, {planner}"] = lambda planner=planner: golden.plan_costs("dense", planner, 30)
    if SHARED.is_dir():
        found["captures"] = lambda: golden.text_figures(CAPTURES.format(folder=SHARED / "mocap"))
        found["graphs of captures"] = graphs_of_captures
        found["world of meshes"] = world_of_meshes
    return found


def workers() -> int:
    """Return the number of worker threads of this variant."""
    return int(os.environ.get("SAME_BITS_WORKERS", "2"))


def events() -> Any:
    """Run doors that close and open, and things that appear, turn and disappear."""
    from tests.support import golden
    from tests.support.two_rooms import WALKERS, two_rooms

    changes = (
        "at: 3, move: {name: crate, by: [0, 3], rotation: 25}",
        "at: 5, close: door_a",
        "at: 8, insert: {name: barrel, cylinder: {center: [9, 3], radius: 0.3}, top: 1.1}",
        "at: 14, open: door_a",
    )
    return golden.text_figures(two_rooms(WALKERS, events=changes))


def floor_plan() -> str:
    """Read a drawing with circles, arcs, thick lines and a block that is rotated and scaled."""
    import ezdxf

    from crowdsim.environment.floor_plans import read_floor_plan

    drawing = ezdxf.new()
    drawing.header["$INSUNITS"] = 6
    block = drawing.blocks.new("column")
    block.add_circle((0.2, 0.1), 0.4)
    space = drawing.modelspace()
    space.add_lwpolyline([(0, 0), (12, 0), (12, 9), (0, 9)], close=True, dxfattribs={"layer": "floor"})
    space.add_arc((5, 4), 2.0, 17.0, 231.0, dxfattribs={"layer": "walls"})
    space.add_line((1, 1), (4, 2.3), dxfattribs={"layer": "walls"})
    space.add_blockref("column", (9, 6), dxfattribs={"layer": "walls", "rotation": 33.0, "xscale": 1.7, "yscale": 1.7})
    with tempfile.TemporaryDirectory() as folder:
        drawing.saveas(Path(folder) / "plan.dxf")
        plan = read_floor_plan(Path(folder) / "plan.dxf", floor_layer="floor")
    text = "".join(solid.footprint.wkb_hex for solid in plan.solids)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def graphs_of_captures() -> str:
    """Build feature-based and standard motion graphs of real captures, and measure the drift of their transitions."""
    from crowdsim.motion.analysis.capture_sets import read_clips
    from crowdsim.motion.analysis.graph_file import GraphSettings, build_graph
    from crowdsim.motion.captures.reader import capture_paths
    from crowdsim.motion.graph.transition_drift import transition_drifts

    digest = hashlib.sha256()
    paths = capture_paths(SHARED / "mocap", ["16_1*.bvh", "16_3*.bvh", "16_4*.bvh"])
    for settings in (GraphSettings(branching=1.8), GraphSettings(standard=True)):
        graph = build_graph(paths, settings)
        for column in (*graph.arrays, *graph.poses, transition_drifts(graph, read_clips(paths)).added):
            digest.update(column.tobytes())
    return digest.hexdigest()[:16]


def world_of_meshes() -> str:
    """Make layers of a furnished house of triangles, rotated out of the axes."""
    from crowdsim.scenario.loader import parse_scenario

    scenario = parse_scenario(HOUSE.format(folder=SHARED / "worlds"))
    text = "".join(layer.free.wkb_hex for layer in scenario.environment.layers)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def variants(quick: bool, folder: Path) -> Iterator[tuple[str, dict[str, str]]]:
    """Yield names of processors, libraries and settings, with the environment variables that select them."""
    slow_paths = "glibc.cpu.hwcaps=-AVX2,-FMA,-AVX512F,-FMA4"
    disabled = {"NPY_DISABLE_CPU_FEATURES": " ".join(dispatched_features())}
    yield "as is", {}
    yield (
        "oldest processor, 1 worker",
        {"GLIBC_TUNABLES": slow_paths, **disabled, "OPENBLAS_CORETYPE": "Prescott", "SAME_BITS_WORKERS": "1"},
    )
    library = other_library(folder)
    if library is not None:
        yield "another C library, hash seed 0", {"LD_PRELOAD": str(library), "PYTHONHASHSEED": "0"}
    if quick:
        return
    yield "C library without AVX and FMA", {"GLIBC_TUNABLES": slow_paths}
    yield "numpy without SIMD", disabled
    for name in BLAS_KERNELS:
        yield f"BLAS of {name}", {"OPENBLAS_CORETYPE": name}
    for count in ("1", "4"):
        yield f"{count} workers", {"SAME_BITS_WORKERS": count}
    for seed in ("0", "1"):
        yield f"hash seed {seed}", {"PYTHONHASHSEED": seed}
    yield "numba as it comes", {"CROWDSIM_PLAIN_NUMBA": "1"}
    yield "kernels for any x86-64", {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}


def dispatched_features() -> list[str]:
    """Return the processor features that numpy would use beyond its baseline."""
    import numpy as np

    umath = np._core._multiarray_umath
    return [name for name in umath.__cpu_dispatch__ if umath.__cpu_features__.get(name)]


def other_library(folder: Path) -> Path | None:
    """Compile the C library that perturbs results; return None without a C compiler."""
    compiler = shutil.which("cc")
    if compiler is None:
        print("no C compiler: the variant of another C library is left out")
        return None
    library = folder / "other_libm.so"
    command = [compiler, "-O2", "-fno-builtin", "-shared", "-fPIC", "-o", str(library), str(OTHER_LIBRARY)]
    subprocess.run([*command, "-lm", "-ldl"], check=True)
    return library


def environments(folder: Path) -> Iterator[tuple[str, str]]:
    """Yield Pythons with the lowest and highest supported versions; install missing ones into ``folder``."""
    for name, pins in (("lowest", LOWEST), ("highest", HIGHEST)):
        python = folder / name / "bin" / "python"
        if not python.is_file():
            subprocess.run([sys.executable, "-m", "venv", str(folder / name)], check=True)
            subprocess.run([str(python), "-m", "pip", "install", "-qq", f"{ROOT}[test]", *pins], check=True)
            subprocess.run([str(python), "-m", "pip", "uninstall", "-q", "-y", "crowdsim"], check=True)
        yield f"{name} versions ({', '.join(pins)})", str(python)


def results(python: str, variables: dict[str, str], quick: bool) -> dict[str, Any]:
    """Return the results of a process of its own."""
    command = [python, "-W", "ignore", __file__, "--child", *(["--quick"] if quick else [])]
    done = subprocess.run(
        command, env={**os.environ, **variables}, stdout=subprocess.PIPE, text=True, check=True, timeout=3600
    )
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def main() -> int:
    """Compare all variants; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--versions", type=Path)
    parser.add_argument("--child", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        from crowdsim.jit import cache_folder

        shutil.rmtree(cache_folder() / "maps", ignore_errors=True)  # maps of another variant
        print(json.dumps({name: run() for name, run in cases(options.quick).items()}))
        return 0
    with tempfile.TemporaryDirectory() as folder:
        asked = [(name, sys.executable, variables) for name, variables in variants(options.quick, Path(folder))]
        if options.versions is not None:
            asked += [(name, python, {}) for name, python in environments(options.versions.resolve())]
        wanted: dict[str, Any] = {}
        differs = False
        for name, python, variables in asked:
            found = results(python, variables, options.quick)
            wanted = wanted or found
            other = [case for case in wanted if found[case] != wanted[case]]
            differs |= bool(other)
            print(f"{name}: {'the same' if not other else 'OTHERWISE: ' + ', '.join(other)}", flush=True)
    print(f"{len(wanted)} cases, {len(asked)} variants: {'NOT the same' if differs else 'the same bits'}")
    return int(differs)


if __name__ == "__main__":
    sys.exit(main())
