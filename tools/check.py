"""Run every check of the repository: format, lint, types, import directions and the tests.

All of them run even if some fail; the exit code is 1 if any failed. The tests run in several processes, each test file
in one, the longest files first (tests/conftest.py). The other checks run beside them, one after another, as most of
them leave a processor idle; each prints what it found in one piece when it has ended. They end minutes before the
tests, whose closing line closes the output. With arguments, the checks come first, and the arguments go to a single
pytest: ``python tools/check.py tests/unit -x``.
"""

from __future__ import annotations

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TOOLS = Path(sys.executable).parent
CHECKS = (
    [str(TOOLS / "ruff"), "format", "--check", "."],
    [str(TOOLS / "ruff"), "check", "."],
    [sys.executable, "-m", "mypy"],
    [str(TOOLS / "lint-imports"), "--no-logo"],
)

PROCESSES = min(os.cpu_count() or 1, 4)
"""Number of test processes. Each compiles the kernels that it needs first, so that many more gain nothing."""


def passes(command: list[str], at_once: bool = False) -> bool:
    """Return whether ``command``, run in the repository's root, succeeds; its output goes to the terminal.

    With ``at_once`` it goes there in one piece at the end, on lines of its own, as another command is writing, too.
    """
    name = " ".join(["==", Path(command[0]).name, *command[1:]])
    # The tests start hundreds of processes: each would compile all its modules if Python were told to keep none.
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONDONTWRITEBYTECODE": ""}
    if not at_once:
        print(name, flush=True)
        return subprocess.run(command, cwd=ROOT, env=environment).returncode == 0
    done = subprocess.run(command, cwd=ROOT, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    print(f"\n{name}\n{done.stdout.decode('utf-8', 'replace')}", end="", flush=True)
    return done.returncode == 0


def check_all(at_once: bool = False) -> bool:
    """Run all checks but the tests, and name those that fail; return True if none does."""
    failed = [command for command in CHECKS if not passes(command, at_once)]
    for command in failed:
        print("FAILED:", Path(command[0]).name, *command[1:], flush=True)
    return not failed


def main() -> int:
    """Run all checks; return the exit code."""
    tests = [sys.executable, "-m", "pytest"]
    if sys.argv[1:]:
        checks_pass = check_all()
        tests_pass = passes([*tests, *sys.argv[1:]])
    else:
        with ThreadPoolExecutor(1) as beside:
            checks = beside.submit(check_all, True)
            tests_pass = passes([*tests, "-n", str(PROCESSES), "--dist", "loadfile", "--no-loadscope-reorder"])
            # Raises what the checks have raised.
            checks_pass = checks.result()
    return 0 if tests_pass and checks_pass else 1


if __name__ == "__main__":
    sys.exit(main())
