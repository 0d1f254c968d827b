"""Run cases that may hang or crash in a watched child process."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from queue import Empty, Queue

# Outcomes go to a copy of stdout, which processes that a case starts do not inherit. What cases print goes to stderr.
_CHILD = """
import importlib, json, os, sys
told = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)
case = getattr(importlib.import_module(sys.argv[1]), sys.argv[2])
for number in json.load(sys.stdin):
    print(json.dumps([number, None]), file=told, flush=True)
    try:
        outcome = case(number)
    except Exception as error:
        outcome = f"untyped: {type(error).__name__}: {error}"[:300]
    print(json.dumps([number, outcome]), file=told, flush=True)
"""
_START = 600.0
"""Time allowed until the first outcome of a child [s]: it may have to compile kernels."""


@dataclass
class Tally:
    """Outcomes of cases: the number of each, and the first ones that hung, crashed or raised a wrong exception."""

    outcomes: dict[str, int] = field(default_factory=dict)
    failures: list[tuple[int, str]] = field(default_factory=list)

    def add(self, number: int, outcome: str) -> None:
        """Count an outcome; keep the first failures."""
        kind = outcome.partition(":")[0]
        self.outcomes[kind] = self.outcomes.get(kind, 0) + 1
        if kind in FAILURES and len(self.failures) < 20:
            self.failures.append((number, outcome))

    @property
    def failed(self) -> int:
        """Return the number of failures."""
        return sum(self.outcomes.get(kind, 0) for kind in FAILURES)


FAILURES = ("untyped", "crashed", "hung", "fake")
"""Outcomes that must not occur. ``fake``: a file looks complete but is not."""


def run_cases(case: str, numbers: Sequence[int], seconds: float = 60.0) -> Tally:
    """Run the function ``case``, "module:function", for each of ``numbers``, at most ``seconds`` each; count outcomes.

    The function takes a number and returns the outcome of that case: a word, optionally with details after a colon. An
    exception counts as "untyped"; a case that takes too long, as "hung"; one in which the process ends, as "crashed".
    Cases run in a process of their own. Its first case may take _START; a new process begins behind each case that
    hung or crashed. What cases print goes to stderr.

    Raises
    ------
    RuntimeError
        If a process ends between two cases, or before the first, as the function cannot be imported.
    """
    module, _, name = case.partition(":")
    tally = Tally()
    left = list(numbers)
    while left:
        left = left[_run_child(module, name, left, seconds, tally) :]
    return tally


def _run_child(module: str, name: str, numbers: list[int], seconds: float, tally: Tally) -> int:
    """Run cases until one hangs or crashes; return how many were run, that one included.

    Raise RuntimeError if the child ends between two cases.

    The child writes two lines of JSON for each case: [number, null] before it, so that a crash in it (``begun``)
    differs from one between cases, and [number, outcome] after it.
    """
    child = subprocess.Popen(
        [sys.executable, "-c", _CHILD, module, name], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert child.stdout is not None
    assert child.stdin is not None
    with child.stdin as given:
        json.dump(numbers, given)
    lines: Queue[str | None] = Queue()
    stdout = child.stdout

    def read() -> None:
        """Queue the lines of the child, and None at its end: only a queue can be read with a timeout."""
        for line in stdout:
            lines.put(line)
        lines.put(None)

    threading.Thread(target=read, daemon=True).start()
    # The limit holds from one outcome to the next, whatever else the child writes.
    done, begun, limit, since = 0, False, _START, time.monotonic()
    try:
        while True:
            try:
                line = lines.get(timeout=max(since + limit - time.monotonic(), 0.0))
            except Empty:
                if done == len(numbers):  # all cases are done, only the end of the process hangs
                    return done
                tally.add(numbers[done], f"hung: after {limit:g} s")
                return done + 1
            if line is None:
                child.wait()
                if begun:
                    tally.add(numbers[done], f"crashed: {child.returncode}")
                    return done + 1
                if done < len(numbers):
                    raise RuntimeError(f"the cases of {module} cannot be run, exit code {child.returncode}")
                return done
            number, outcome = json.loads(line)
            begun = outcome is None
            if outcome is not None:
                tally.add(number, outcome)
                done, limit, since = done + 1, seconds, time.monotonic()
    finally:
        child.kill()
        child.wait()
        stdout.close()
