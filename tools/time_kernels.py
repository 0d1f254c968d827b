"""Time the compilation in a first run, for the progress bar: ``python tools/time_kernels.py``.

Runs the corridor with an empty cache and writes ``crowdsim/first_run.json``: the kernels, the CPU seconds that each
takes with the helpers that it needs first, and the types of its arguments. Only ratios of times matter, so any idle
machine will do.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections import defaultdict
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
FILE = ROOT / "crowdsim" / "first_run.json"


def main() -> None:
    """Run :func:`time_run` in a process of its own, so that the cache is empty."""
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "CROWDSIM_CACHE": folder, "PYTHONPATH": str(ROOT)}
        subprocess.run([sys.executable, __file__, folder], env=environment, check=True)


def time_run(folder: str) -> None:
    """Run the corridor and write what it compiles."""
    import time

    from numba.core import event

    from crowdsim.first_run import FirstKernel, write_kernels
    from crowdsim.jit import kernel_name

    seconds: defaultdict[tuple[str, Any], float] = defaultdict(float)
    begun: list[float] = []
    within = [0.0]

    class Watcher(event.Listener):
        def on_start(self, event: object) -> None:
            within.append(0.0)
            begun.append(time.thread_time())

        def on_end(self, event: object) -> None:
            inner = within.pop()
            taken = time.thread_time() - begun.pop()
            dispatcher = event.data["dispatcher"]
            if kernel_name(dispatcher) is None:
                within[-1] += inner
            else:
                function = f"{dispatcher.py_func.__module__}.{dispatcher.py_func.__qualname__}"
                # Those that another kernel has called are compiled with it.
                seconds[function, None if begun else event.data["args"]] += taken - inner
                within[-1] += taken

    event.register("numba:compile", Watcher())
    # Some kernels are compiled as these are imported.
    from crowdsim.crowd.simulation import Simulation
    from crowdsim.scenario.loader import load_scenario

    Simulation(load_scenario("corridor"), workers=1).run(Path(folder) / "corridor.h5").close()
    write_kernels(FILE, [FirstKernel(name, taken, arguments) for (name, arguments), taken in seconds.items()])
    print(f"{len(seconds)} kernels, {sum(seconds.values()):.1f} s")


if __name__ == "__main__":
    if len(sys.argv) > 1:
        time_run(sys.argv[1])
    else:
        main()
