"""What a first run compiles is listed as it is, and other processes compile it ahead."""

import importlib
import inspect
import json
import os
import signal
import subprocess
import sys
import time
from importlib.resources import files

import pytest

from crowdsim import first_run
from crowdsim.first_run import CompilingAhead, read_kernels, read_seconds, write_kernels

RUN = """
import json, sys
from pathlib import Path
from crowdsim.crowd.simulation import Simulation
from crowdsim.first_run import _imported, read_kernels
from crowdsim.jit import kernel_name
from crowdsim.scenario.loader import load_scenario
from numba.core.dispatcher import Dispatcher

Simulation(load_scenario("corridor"), workers=1).run(Path(sys.argv[1])).close()
used = set()
for module in [each for name, each in sys.modules.items() if name.startswith("crowdsim.")]:
    for each in vars(module).values():
        if isinstance(each, Dispatcher) and kernel_name(each):
            function = each.py_func.__module__ + "." + each.py_func.__qualname__
            used |= {(function, arguments) for arguments in each.overloads}
listed = {(each.function, each.arguments) for each in read_kernels() if each.arguments is not None}
within = {each.function for each in read_kernels() if each.arguments is None}
print(json.dumps({
    "not listed": sorted({function for function, arguments in used - listed if function not in within}),
    "not used": sorted({function for function, arguments in listed - used}),
}))
"""

PART = """
from crowdsim import first_run
listed = [each for each in first_run.read_kernels() if each.arguments is not None]
kernels = sorted(listed, key=lambda each: each.seconds)[:8]
first_run.read_kernels = lambda: kernels
for part in range(2):
    first_run.compile_last_first(part, 2)
kept = first_run.compiled_kernels()
print(len({each.name for each in kernels}), all(each.name in kept for each in kernels))
"""

PARENT = """
import time
from crowdsim.first_run import CompilingAhead
with CompilingAhead(1e9) as ahead:
    print(ahead._processes[0].pid, flush=True)
    time.sleep(60.0)
"""


def python(code: str, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run code in a new process."""
    return subprocess.run(
        [sys.executable, "-c", code, *arguments],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=600,
        check=True,
    )


def test_what_is_listed_is_what_a_run_of_the_corridor_calls(tmp_path):
    """After a change of a kernel's arguments, run ``python tools/time_kernels.py``."""
    found = json.loads(python(RUN, str(tmp_path / "corridor.h5")).stdout)
    assert found["not listed"] == []
    # An earlier run has stored the motion maps.
    assert set(found["not used"]) <= {"crowdsim.following.maps.map_kernels.grow_maps"}


def test_the_list_is_read_as_it_is_written(tmp_path):
    write_kernels(tmp_path / "again.json", read_kernels())
    assert (tmp_path / "again.json").read_text() == files("crowdsim").joinpath("first_run.json").read_text()


def test_times_are_read_without_the_modules_of_the_arguments():
    seconds = read_seconds()
    assert list(seconds) == list(dict.fromkeys(each.name for each in read_kernels()))
    assert sum(seconds.values()) == pytest.approx(sum(each.seconds for each in read_kernels()))
    code = "import sys; from crowdsim.first_run import read_seconds; read_seconds(); "
    code += "print('crowdsim.crowd' in sys.modules)"
    assert python(code).stdout.strip() == "False"


def test_each_kernel_has_a_type_for_each_parameter():
    listed = [each for each in read_kernels() if each.arguments is not None]
    assert len(listed) > 40
    for each in listed:
        module, _, name = each.function.rpartition(".")
        kernel = getattr(importlib.import_module(module), name)
        assert len(inspect.signature(kernel.py_func).parameters) == len(each.arguments), each.function


def test_a_type_of_another_kind_is_refused():
    with pytest.raises(ValueError, match=r"first_run\.json"):
        first_run._type(["list", 1, 2], [])


def test_parts_together_compile_all(tmp_path):
    count, is_all = python(PART, CROWDSIM_CACHE=str(tmp_path)).stdout.split()
    assert int(count) > 5
    assert is_all == "True"


@pytest.mark.parametrize(
    ("missing", "processors", "shares", "count"),
    [(5.0, 4, True, 0), (60.0, 1, True, 0), (60.0, 2, True, 1), (60.0, 64, True, 3), (60.0, 4, False, 0)],
)
def test_processes_help_where_it_is_worthwhile(monkeypatch, missing, processors, shares, count):
    begun = []
    monkeypatch.setattr(first_run, "usable_processors", lambda: processors)
    monkeypatch.setattr(first_run, "shares_cache", lambda: shares)
    monkeypatch.setattr(first_run.subprocess, "Popen", lambda command, **_: begun.append(command[-2:]))
    assert CompilingAhead(missing).count == count
    assert begun == [[str(part), str(count)] for part in range(count)]


def test_processes_end_with_what_asked_for_them(monkeypatch):
    monkeypatch.setattr(first_run, "usable_processors", lambda: 2)
    with CompilingAhead(60.0) as ahead:
        [process] = ahead._processes
        assert process.poll() in (None, 0)
    assert process.poll() in (0, -signal.SIGKILL)


@pytest.mark.skipif(first_run.usable_processors() < 2, reason="needs two processors")
def test_a_killed_run_leaves_no_process(tmp_path):
    environment = {**os.environ, "CROWDSIM_CACHE": str(tmp_path)}
    parent = subprocess.Popen([sys.executable, "-c", PARENT], env=environment, stdout=subprocess.PIPE)
    child = int(parent.stdout.readline())
    time.sleep(1.0)
    os.kill(child, 0)  # it is there
    parent.kill()
    parent.communicate()
    for _ in range(300):
        try:
            os.kill(child, 0)
        except ProcessLookupError:
            return
        time.sleep(0.1)
    raise AssertionError("the process that compiles ahead is still there")
