"""Run every check of the repository: format, lint, types, import directions, then the tests.

All of them run even if some fail; the exit code is 1 if any failed. The tests come last, so that their closing line
closes the output. They run in several processes, each test file in one, the longest files first (tests/conftest.py);
arguments go to a single pytest instead:
``python tools/check.py tests/unit -x``.
"""

from __future__ import annotations

import os
import subprocess
import sys
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


def passes(command: list[str]) -> bool:
    """Return whether ``command``, run in the repository's root, succeeds; its output goes to the terminal."""
    print("==", Path(command[0]).name, *command[1:], flush=True)
    # The tests start hundreds of processes: each would compile all its modules if Python were told to keep none.
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONDONTWRITEBYTECODE": ""}
    return subprocess.run(command, cwd=ROOT, env=environment).returncode == 0


def main() -> int:
    """Run all checks; return the exit code."""
    failed = [command for command in CHECKS if not passes(command)]
    for command in failed:
        print("FAILED:", Path(command[0]).name, *command[1:], flush=True)
    arguments = sys.argv[1:] or ["-n", str(PROCESSES), "--dist", "loadfile", "--no-loadscope-reorder"]
    tests_pass = passes([sys.executable, "-m", "pytest", *arguments])
    return 0 if tests_pass and not failed else 1


if __name__ == "__main__":
    sys.exit(main())
