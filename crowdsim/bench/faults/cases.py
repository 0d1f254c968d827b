"""Fault cases by number; each returns a word for its outcome.

"fine"; "refused": an error with a remedy; "anew": damaged cached data was made again; or a failure
(:data:`crowdsim.bench.faults.watched.FAILURES`). Untyped errors, crashes and hangs are detected from outside.
"""

from __future__ import annotations

import atexit
import os
import shutil
import subprocess
import sys
import tempfile
import time
import warnings
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.bench.faults.contents import all_values, read_all
from crowdsim.bench.faults.mesh_edits import edit_at_random
from crowdsim.bench.faults.mutations import mutate_parts, mutated
from crowdsim.errors import CacheWarning, CrowdSimError
from crowdsim.library import library_folder
from crowdsim.motion.graph.arrays import GraphArrays
from crowdsim.recording.reader import Recording
from crowdsim.recording.recovery import recover
from crowdsim.recording.writer import part_path

RECORDINGS = "CROWDSIM_FAULT_RECORDINGS"
"""Environment variable: a folder of recordings to damage."""

FINE, REFUSED, ANEW, FAKE = "fine", "refused", "anew", "fake"


def edited_mesh(number: int) -> str:
    """Apply a random sequence of edits to a mesh; "refused" if one of them was."""
    return REFUSED if edit_at_random(number) else FINE


def mutated_scenario(number: int) -> str:
    """Load and check a built-in scenario with random faults: "fine" or "refused"."""
    from crowdsim.scenario.check import check_scenario
    from crowdsim.scenario.loader import load_scenario

    files = sorted(library_folder("scenarios").glob("*.yaml"))
    file = files[number % len(files)]
    path = _folder() / file.name
    path.write_bytes(mutated(file.read_bytes(), np.random.default_rng(number), text=True))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            check_scenario(load_scenario(str(path)))
        except CrowdSimError:
            return REFUSED
    return FINE


def mutated_clip(number: int) -> str:
    """Read a clip with random faults: "fine" or "refused"."""
    from crowdsim.motion.captures.reader import read_capture

    path = _folder() / "clip.bvh"
    path.write_bytes(mutated(_clips()[number % len(_clips())], np.random.default_rng(number), text=True))
    try:
        read_capture(path)
    except CrowdSimError:
        return REFUSED
    return FINE


def mutated_recording(number: int) -> str:
    """Read all of a recording with random faults.

    Odd numbers damage its bytes: all values that can be read must then be those that were written (else "fake"). Even
    numbers change its datasets by HDF5, which removes the checksums of those it writes anew: other values are "fine".
    """
    rng = np.random.default_rng(number)
    given = number // 2 % len(_recordings())
    content = _recordings()[given]
    path = _folder() / "recording.h5"
    if number % 2:
        path.write_bytes(mutated(content, rng))
    else:
        path.write_bytes(content)
        mutate_parts(path, rng)
    try:
        read_all(path)
    except CrowdSimError:
        return REFUSED
    return FAKE if number % 2 and all_values(path) != _recorded(given) else FINE


def damaged_map(number: int) -> str:
    """Request cached motion maps whose file has random faults.

    They must be equal to the undamaged ones (else "fake"); a warning tells that they were made anew.
    """
    from crowdsim.following.maps.map_file import maps_in_file

    graph, folder = _graph(), _folder() / "maps"
    right: tuple[NDArray[Any], ...] = tuple(maps_in_file(folder, graph, depth=1).arrays)
    (file,) = folder.iterdir()
    content = mutated(file.read_bytes(), np.random.default_rng(number))
    file.unlink()  # the old file is mapped into memory: write a new one instead of changing it
    file.write_bytes(content)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        maps: tuple[NDArray[Any], ...] = tuple(maps_in_file(folder, graph, depth=1).arrays)
    if not all(np.array_equal(one, other) for one, other in zip(maps, right, strict=True)):
        return FAKE
    return ANEW if any(issubclass(each.category, CacheWarning) for each in said) else FINE


def damaged_kernel(number: int) -> str:
    """Call a cached kernel whose file has random faults, in a new process.

    It must return what the undamaged one does (else "fake"); a warning tells that it was compiled anew.
    """
    kept = _folder() / "kernels"
    if not kept.exists():
        _call_kernel(kept)
    folder = _folder() / "damaged"
    shutil.copytree(kept, folder)
    try:
        files = sorted(path for path in folder.rglob("*.nb?"))
        file = files[number % len(files)]  # numba's index (.nbi) or compiled code (.nbc)
        file.write_bytes(mutated(file.read_bytes(), np.random.default_rng(number)))
        done = _call_kernel(folder)
    finally:
        shutil.rmtree(folder)
    if done.returncode:
        return f"crashed: {done.returncode} {done.stderr[-200:]}"
    if done.stdout.strip() != "3":  # what the undamaged kernel returns
        return FAKE
    return ANEW if "CacheWarning" in done.stderr else FINE


def killed_run(number: int) -> str:
    """Kill a run at a random moment and recover it; "fake" if the recording lacks a step that the run has reported.

    It is also "fake" if a recording that is not complete says that it is.
    """
    rng = np.random.default_rng(number)
    changes = [f"agents.0.locomotion={('steered', 'captured')[number % 2]}", "agents.0.count=2", f"duration={_SECONDS}"]
    file = _folder() / "killed.h5"
    child = subprocess.Popen([sys.executable, "-c", _RUN, str(file), *changes], stdout=subprocess.PIPE, text=True)
    assert child.stdout is not None
    # The run prints the number of each step that it has done; it is killed shortly after that of a random one.
    last, wanted = 0, int(rng.integers(1, 90))
    with child.stdout as told:
        for line in told:
            last = int(line)
            if last >= wanted and child.poll() is None:
                time.sleep(rng.uniform(0.0, 0.01))
                child.kill()
        child.wait()
    part = part_path(file)
    try:
        # Exactly one of them is there: the .part, or, once the run has given it its name, the file.
        if file.exists() == part.exists():
            return f"{FAKE}: {'both files' if part.exists() else 'no file'} after step {last}"
        with Recording.open(file) if file.exists() else recover(part) as recording:
            # A run that ended is complete. One that was killed is not, unless that was after its last step.
            ended = child.returncode == 0
            at_end = recording.steps == _SECONDS * recording.steps_per_second
            whole = recording.steps >= last and (recording.complete == ended or (not ended and at_end))
            lost = last - recording.steps
            read_all(file)
    finally:
        part.unlink(missing_ok=True)
        file.unlink(missing_ok=True)
    return FINE if whole else f"{FAKE}: {lost} steps of {last} are lost, or it does not say that it is not complete"


_SECONDS = 8
"""Duration of the runs that are killed [s]."""

_RUN = """
import sys
from crowdsim.crowd.simulation import Simulation
from crowdsim.scenario.loader import load_scenario
scenario = load_scenario("corridor", sys.argv[2:])
Simulation(scenario, workers=1).run(sys.argv[1], progress=lambda step, steps, simulation: print(step, flush=True))
"""


def _call_kernel(folder: Path) -> subprocess.CompletedProcess[str]:
    """Call a kernel in a process of its own, whose kernel cache is ``folder``; it prints 3 if all is well."""
    program = "from crowdsim.navmesh.mesh.half_edge_kernels import nxt; print(nxt(5))"
    return subprocess.run(
        [sys.executable, "-c", program],
        env={**os.environ, "CROWDSIM_CACHE": str(folder)},
        capture_output=True,
        text=True,
        timeout=120.0,
    )


@cache
def _graph() -> GraphArrays:
    """Return the motion graph of the built-in frontal walk."""
    from crowdsim.behaviors.library import load_behavior_set

    return load_behavior_set(["frontal"], [(0.1, 2.0)]).graph.arrays


@cache
def _recorded(number: int) -> dict[str, tuple[Any, ...]]:
    """Return all values of recording ``number`` of :func:`_recordings`, undamaged, see :func:`all_values`."""
    path = _folder() / "whole.h5"
    path.write_bytes(_recordings()[number])
    return all_values(path)


@cache
def _recordings() -> list[bytes]:
    """Return the recordings in the folder RECORDINGS, or short real ones.

    The short ones are of all levels, of two groups with a measured area, and of a changing place.
    """
    given = os.environ.get(RECORDINGS)
    if given:
        found = [path.read_bytes() for path in sorted(Path(given).glob("*.h5"))]
        if not found:
            raise CrowdSimError(
                f"{RECORDINGS}: there is no recording (.h5) in {given}; name another folder, or unset it"
            )
        return found
    from crowdsim.crowd.simulation import Simulation
    from crowdsim.scenario.loader import load_scenario, parse_scenario

    few = ["agents.0.count=2", "duration=6"]
    levels = ("captured", "steered", "auto")
    scenarios = [load_scenario("corridor", [f"agents.0.locomotion={each}", *few]) for each in levels]
    scenarios += [load_scenario("counterflow", ["agents.1.count=3", *few]), parse_scenario(_PLACE)]
    made = []
    for number, scenario in enumerate(scenarios):
        file = _folder() / f"{number}.h5"
        with Simulation(scenario).run(file):
            made.append(file.read_bytes())
    return made


_PLACE = """
crowdsim: 1
name: changing place
seed: 3
duration: 8
floor: {rectangle: [0, 0, 10, 6]}
doors:
  - {name: door, box: {min: [4.9, 2.4], max: [5.1, 3.6]}, top: 2.1}
obstacles:
  - {name: north, box: {min: [4.9, 3.6], max: [5.1, 6]}, top: 2.5}
  - {name: south, box: {min: [4.9, 0], max: [5.1, 2.4]}, top: 2.5}
  - {name: crate, box: {center: [8, 5], size: [0.8, 0.6]}, top: 0.9}
agents:
  - {name: auto, count: 2, start: {rectangle: [0.5, 0.5, 2, 5]}, goal: {rectangle: [8.5, 0.5, 9.5, 3]}}
  - {name: steered, locomotion: steered, count: 3, start: {rectangle: [2.5, 0.5, 4, 5]},
     goal: {rectangle: [6.5, 2.2, 9.6, 4.4]}, on_arrival: stay, together: 3}
events:
  - {at: 1, move: {name: crate, by: [0.5, -0.3], rotation: 30}}
  - {at: 2, insert: {name: barrel, cylinder: {center: [7, 1], radius: 0.3}, top: 1.1}}
  - {at: 4, remove: barrel}
  - {at: 7, close: door}
lines:
  - {name: door, points: [[5, 2.4], [5, 3.6]]}
areas:
  - {name: hall, rectangle: [5.1, 0, 10, 6]}
"""


@cache
def _folder() -> Path:
    """Return the folder of this process for files of cases, which is removed when it ends."""
    folder = tempfile.TemporaryDirectory()
    atexit.register(folder.cleanup)
    return Path(folder.name)


@cache
def _clips() -> list[bytes]:
    """Return the four smallest built-in clips, so that cases are fast."""
    files = sorted(library_folder("behaviors").rglob("*.bvh"), key=lambda path: (path.stat().st_size, path.name))
    return [path.read_bytes() for path in files[:4]]
