"""Time the compilation in a first run, for the progress bar: ``python tools/time_kernels.py``.

Runs the corridor with an empty cache and writes ``crowdsim/first_run.txt``: the kernels, and the CPU seconds that each
takes with the helpers that it needs first. Only their ratios matter, so any idle machine will do.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FILE = ROOT / "crowdsim" / "first_run.txt"


def main() -> None:
    """Run :func:`time_run` in a process of its own, so that the cache is empty."""
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "CROWDSIM_CACHE": folder, "PYTHONPATH": str(ROOT)}
        subprocess.run([sys.executable, __file__, folder], env=environment, check=True)


def time_run(folder: str) -> None:
    """Run the corridor and write the compilation times."""
    import time

    from numba.core import event

    from crowdsim.crowd.simulation import Simulation
    from crowdsim.jit import kernel_name
    from crowdsim.scenario.loader import load_scenario

    seconds: defaultdict[str, float] = defaultdict(float)
    begun: list[float] = []
    within = [0.0]

    class Watcher(event.Listener):
        def on_start(self, event: object) -> None:
            within.append(0.0)
            begun.append(time.thread_time())

        def on_end(self, event: object) -> None:
            inner = within.pop()
            taken = time.thread_time() - begun.pop()
            name = kernel_name(event.data["dispatcher"])
            if name is None:
                within[-1] += inner
            else:
                seconds[name] += taken - inner
                within[-1] += taken

    event.register("numba:compile", Watcher())
    Simulation(load_scenario("corridor"), workers=1).run(Path(folder) / "corridor.h5").close()
    lines = [f"{taken:.2f} {name}\n" for name, taken in seconds.items()]
    FILE.write_text("".join(lines), encoding="utf-8")
    print(f"{len(lines)} kernels, {sum(seconds.values()):.1f} s")


if __name__ == "__main__":
    if len(sys.argv) > 1:
        time_run(sys.argv[1])
    else:
        main()
