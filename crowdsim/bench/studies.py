"""Studies: points a minute of a sweep beside calls of ``crowdsim run``, a sweep that is killed, and an analysis.

All are whole programs, from the shell to the last file, with kernels compiled. CPU times are those of all processes:
on a busy machine they say more than times of a clock.
"""

from __future__ import annotations

import contextlib
import os
import random
import resource
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from crowdsim.bench.registry import Measurement
from crowdsim.errors import CrowdSimError

SCENARIO = "doorway"

_SEED = 7
"""Seed of the moments at which the sweep is killed."""

_MOST_SECONDS = 600.0
"""Time after which a sweep is killed even if it has not done the points that are waited for [s]."""


def measure(points: int = 200, calls: int = 20, killed_points: int = 40, kills: int = 10) -> Measurement:
    """Sweep ``points`` seeds, run ``calls`` of them one by one, analyze a plaza, and kill another sweep repeatedly.

    The other sweep has ``killed_points`` points. It is killed ``kills`` times, then goes on to its end. The figure
    ``kills`` counts the times at which it was still running.

    Raises
    ------
    CrowdSimError
        If a run fails, or a sweep that was killed ends with another table.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _call(["run", SCENARIO, "-o", "first.h5"], folder)  # not timed: it compiles kernels
        before = time.perf_counter(), _cpu()
        for seed in range(1, calls + 1):
            _call(["run", SCENARIO, "--seed", str(seed), "-o", "run.h5"], folder)
        rows = [_row("run, called for each", calls, before)]
        before = time.perf_counter(), _cpu()
        _call(_sweep("whole", points), folder)
        rows.append(_row("sweep", points, before))
        _call(["run", "plaza", "-o", "plaza.h5"], folder)
        before = time.perf_counter(), _cpu()
        _call(["analyze", "plaza.h5"], folder)
        rows.append(_row("analyze plaza", 1, before))
        # The table to compare with: points that are done in this folder need no run again.
        _call(_sweep("whole", killed_points), folder)
        done = _kill(folder, killed_points, kills)
        _call(_sweep("killed", killed_points), folder)
        tables = [(folder / sweep / "sweep.csv").read_bytes() for sweep in ("whole", "killed")]
    if tables[0] != tables[1]:
        raise CrowdSimError(f"a sweep that was killed {done} times ended with another table; this is a bug")
    figures = {
        "run_points_a_minute": rows[0]["points_a_minute"],
        "sweep_points_a_minute": rows[1]["points_a_minute"],
        "sweep_times_run": round(rows[1]["points_a_minute"] / rows[0]["points_a_minute"], 2),
        "cpu_times_run": round(rows[0]["cpu_s_a_point"] / rows[1]["cpu_s_a_point"], 2),
        "kills": done,
        "analyze_plaza_s": rows[2]["seconds"],
        "analyze_plaza_cpu_s": rows[2]["cpu_s_a_point"],
    }
    return Measurement(rows, figures, tuple(figures))


def _row(what: str, points: int, before: tuple[float, float]) -> dict[str, Any]:
    """Return the row of ``points`` runs since ``before``, which holds the times of the clock and the CPU then [s]."""
    seconds, cpu = time.perf_counter() - before[0], _cpu() - before[1]
    return {
        "how": what,
        "points": points,
        "seconds": round(seconds, 1),
        "points_a_minute": round(60.0 * points / seconds, 2),
        "cpu_s_a_point": round(cpu / points, 2),
    }


def _cpu() -> float:
    """Return the CPU time of all processes that were started from here and have ended [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _sweep(folder: str, points: int) -> list[str]:
    """Return the arguments of a sweep of SCENARIO with the seeds from 1 to ``points``."""
    return ["sweep", SCENARIO, folder, "--seeds", f"1-{points}"]


def _call(arguments: list[str], folder: Path) -> None:
    """Run crowdsim with ``arguments`` in ``folder``; raise CrowdSimError if it fails."""
    command = [sys.executable, "-m", "crowdsim", *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    if done.returncode:
        raise CrowdSimError(f"crowdsim {' '.join(arguments)} failed: {done.stderr[-400:]}")


def _kill(folder: Path, points: int, kills: int) -> int:
    """Start a sweep and kill all its processes at a random moment, ``kills`` times; return how often it was running.

    A sweep that ends before its moment does not count.
    """
    draw, done = random.Random(_SEED), 0
    command = [sys.executable, "-m", "crowdsim", *_sweep("killed", points)]
    for left in range(kills, 0, -1):
        # Wait until a random number of further points are done. It is at most an even share of the points left for each
        # kill left, so that later kills find points to do, too.
        found = _done(folder)
        wanted = found + draw.randint(0, max((points - found) // left, 0))
        running = subprocess.Popen(
            command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
        )
        until = time.monotonic() + _MOST_SECONDS
        while running.poll() is None and _done(folder) < wanted and time.monotonic() < until:
            time.sleep(0.05)
        # A random time longer than a start or a point takes, so that the kill may come anywhere in either.
        time.sleep(draw.uniform(0.0, 3.0))
        # A sweep that has ended by itself has no processes left to kill.
        done += running.poll() is None
        with contextlib.suppress(ProcessLookupError):
            os.killpg(running.pid, signal.SIGKILL)
        running.wait()
    return done


def _done(folder: Path) -> int:
    """Return the number of points that the sweep in ``folder/killed`` has done."""
    return len(list(folder.glob("killed/points/*.json")))
