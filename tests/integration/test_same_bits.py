"""A run does not hang on the processor, on the C library or on the number of workers: a short form of the tool."""

import subprocess
import sys
from pathlib import Path

TOOL = Path(__file__).parents[2] / "tools" / "same_bits.py"


def test_runs_are_the_same_on_other_processors(environment: dict[str, str]) -> None:
    done = subprocess.run(
        [sys.executable, str(TOOL), "--quick"], env=environment, capture_output=True, text=True, timeout=900
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "the same bits" in done.stdout
