"""Run cases that may hang or crash in a watched child process."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
from collections.abc import Sequence
from dataclasses import dataclass, field
from queue import Empty, Queue

_CHILD = """
import importlib, json, sys
case = getattr(importlib.import_module(sys.argv[1]), sys.argv[2])
for number in json.load(sys.stdin):
    print(json.dumps([number, None]), flush=True)
    try:
        outcome = case(number)
    except Exception as error:
        outcome = f"untyped: {type(error).__name__}: {error}"[:300]
    print(json.dumps([number, outcome]), flush=True)
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
    """Run ``case``, "module:function", for each of ``numbers``, for at most ``seconds`` each.

    The first case of a process may take _START; a new process begins behind each case that hung or crashed. The
    function returns its outcome, a word, optionally with details after a colon. If the process ends in a case, that
    has crashed.
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

    The child prints a line before each case, so that a crash in it (``begun``) differs from one between cases, and one
    with its outcome.
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
        for line in stdout:
            lines.put(line)
        lines.put(None)

    threading.Thread(target=read, daemon=True).start()
    done, begun, limit = 0, False, _START
    try:
        while True:
            try:
                line = lines.get(timeout=limit)
            except Empty:
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
            if not line.startswith("["):  # printed by a case itself
                continue
            number, outcome = json.loads(line)
            begun = outcome is None
            if outcome is not None:
                tally.add(number, outcome)
                done, limit = done + 1, seconds
    finally:
        child.kill()
        child.wait()
        stdout.close()
