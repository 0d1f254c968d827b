"""Runs give the same bits with the lowest numba that is supported, and with numba as it comes."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support import golden

ROOT = Path(__file__).parents[2]
LOWEST = ("numba==0.61.0", "numpy==2.0.*")
RUN = """
import json, numba
from tests.support import golden
print(json.dumps([numba.__version__, golden.library_figures("doorway")]))
"""


def version_and_figures(environment: dict[str, str], **variables: str) -> tuple[str, dict[str, object]]:
    """Version of numba in a process of its own, and what the run of a short scenario gives there."""
    done = subprocess.run(
        [sys.executable, "-W", "error::RuntimeWarning", "-c", RUN],
        cwd=ROOT,
        env=environment | variables,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    version, figures = json.loads(done.stdout.splitlines()[-1])
    return version, figures


@pytest.fixture(scope="module")
def expected() -> dict[str, object]:
    stored: dict[str, object] = json.loads(golden.FILE.read_text(encoding="utf-8"))["scenarios"]["doorway"]
    return stored


def test_numba_as_it_comes_gives_the_same_run(environment: dict[str, str], expected: dict[str, object]) -> None:
    assert version_and_figures(environment, CROWDSIM_PLAIN_NUMBA="1")[1] == expected


def test_the_lowest_numba_gives_the_same_run(
    environment: dict[str, str], expected: dict[str, object], tmp_path: Path
) -> None:
    """With its private parts: a warning that these do not fit is an error. All other tests run the highest."""
    install = [sys.executable, "-m", "pip", "install", "-qq", "--target", str(tmp_path), *LOWEST]
    done = subprocess.run(install, capture_output=True, text=True)
    if done.returncode and "No matching distribution" in done.stderr:
        pytest.skip(f"the package index gives no {LOWEST[0]}: {done.stderr.strip().splitlines()[-1]}")
    assert done.returncode == 0, done.stderr
    path = f"{tmp_path}:{environment['PYTHONPATH']}"
    version, figures = version_and_figures(environment, PYTHONPATH=path)
    assert version == "0.61.0"
    assert figures == expected
