"""Compiled kernels in files: each signature in one of its own, and none after an edit of what it depends on."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from crowdsim.errors import CacheWarning
from crowdsim.jit import kernel_sources
from crowdsim.numba_internals import _CheckedCacheFile

PACKAGE = Path(__file__).parents[3] / "crowdsim"


def test_processes_that_compile_two_signatures_at_once_keep_both(tmp_path: Path) -> None:
    """numba would name both files by the number 1, as neither process has seen the file of the other."""
    one, other = (_CheckedCacheFile(str(tmp_path), "doubled-1.py311", None) for _ in range(2))
    assert one.load(("int64",)) is None
    assert other.load(("float64",)) is None
    one.save(("int64",), "code for integers")
    other.save(("float64",), "code for floats")
    assert one.load(("float64",)) == "code for floats"
    assert other.load(("int64",)) == "code for integers"
    assert len(list(tmp_path.iterdir())) == 2


def test_the_code_of_another_signature_is_never_run(tmp_path: Path) -> None:
    cache = _CheckedCacheFile(str(tmp_path), "doubled-1.py311", None)
    cache.save(("int64",), "code for integers")
    (first,) = tmp_path.iterdir()
    cache.save(("float64",), "code for floats")
    (second,) = set(tmp_path.iterdir()) - {first}
    shutil.copy(first, second)
    with pytest.warns(CacheWarning, match="damaged and compiled again"):
        assert cache.load(("float64",)) is None
    assert cache.load(("int64",)) == "code for integers"


def test_code_of_an_older_source_is_not_run(tmp_path: Path) -> None:
    _CheckedCacheFile(str(tmp_path), "doubled-1.py311", (1.0, 20)).save(("int64",), "old")
    assert _CheckedCacheFile(str(tmp_path), "doubled-1.py311", (2.0, 20)).load(("int64",)) is None


def test_constants_that_kernels_import_are_among_their_sources() -> None:
    """An edit of any of these files starts a new cache folder, as numba compiles constants into kernels."""
    names = {path.relative_to(PACKAGE).as_posix() for path in kernel_sources(PACKAGE)}
    assert {"constants.py", "crowd/state/components.py", "recording/header.py", "jit.py", "numba_internals.py"} <= names
    assert {path.relative_to(PACKAGE).as_posix() for path in PACKAGE.rglob("*_kernels.py")} <= names
    assert not {"cli/app.py", "playback/film.py"} & names


def test_another_checkout_takes_what_one_has_compiled(tmp_path: Path) -> None:
    """Files of a second checkout are as many seconds old as it is; their kernels are the same."""
    program = "import numpy as np; from crowdsim.steering.guidance.crowding_kernels import add_agents as kernel; "
    program += (
        "kernel(np.zeros((1, 2)), np.ones(1), 0.0, 0.0, 1.0, np.zeros((3, 3), np.int64)); "
        "print(dict(kernel.stats.cache_hits))"
    )
    told = []
    for name in ("one", "other"):
        shutil.copytree(
            PACKAGE, tmp_path / name / "crowdsim", ignore=shutil.ignore_patterns("__pycache__", "node_modules")
        )
        file = tmp_path / name / "crowdsim" / "steering" / "guidance" / "crowding_kernels.py"
        os.utime(file, (1_000_000_000 + len(told), 1_000_000_000 + len(told)))
        environment = {**os.environ, "PYTHONPATH": str(tmp_path / name), "CROWDSIM_CACHE": str(tmp_path / "cache")}
        done = subprocess.run(
            [sys.executable, "-c", program], cwd=tmp_path, env=environment, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
        told.append(done.stdout.strip())
    assert told[0] == "{}"
    assert told[1] != "{}"
