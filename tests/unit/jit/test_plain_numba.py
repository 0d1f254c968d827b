"""numba as it comes: taken if asked for, and with a warning if numba is not built as expected."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

FILE = """
import numpy as np
from crowdsim.jit import array_at, cache_folder, helper, kernel

@helper
def total(values):
    return values.sum()

@kernel
def total_at(address, values):
    return total(array_at(address, (2, 3), np.float64)) + total(values)

values = np.arange(6.0)
assert total_at(values.ctypes.data, values) == 30.0
print(cache_folder())
"""
OTHERWISE = {
    "a class that is gone": "import numba.core.typed_passes as passes; del passes.NativeLowering",
    "a compilation that fails": """
from numba.core.compiler_machinery import PassManager
usual = PassManager.__init__
def init(self, name):
    if name == "crowdsim":
        raise AttributeError("no passes of others")
    usual(self, name)
PassManager.__init__ = init
""",
}


def run(folder: Path, before: str = "", **variables: str) -> subprocess.CompletedProcess[str]:
    """Call a kernel with a helper in a process of its own, with an empty cache."""
    (folder / "kernels.py").write_text(f"{before}\n{FILE}", encoding="utf-8")
    environment = {**os.environ, "CROWDSIM_CACHE": str(folder / "cache"), **variables}
    return subprocess.run(
        [sys.executable, str(folder / "kernels.py")], env=environment, capture_output=True, text=True, check=True
    )


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> subprocess.CompletedProcess[str]:
    return run(tmp_path_factory.mktemp("plain"), CROWDSIM_PLAIN_NUMBA="1")


def kernels_of(done: subprocess.CompletedProcess[str]) -> str:
    """Name of the cache folder."""
    return Path(done.stdout.strip()).name


def test_plain_kernels_are_kept_beside_the_others(tmp_path: Path, plain: subprocess.CompletedProcess[str]) -> None:
    usual = run(tmp_path)
    assert usual.stderr == plain.stderr == ""
    assert kernels_of(usual) != kernels_of(plain)


@pytest.mark.parametrize("change", OTHERWISE.values(), ids=OTHERWISE.keys())
def test_another_numba_is_taken_as_it_comes_with_a_warning(
    tmp_path: Path, plain: subprocess.CompletedProcess[str], change: str
) -> None:
    done = run(tmp_path, change)
    assert "RuntimeWarning: kernels are slower with numba" in done.stderr
    assert kernels_of(done) == kernels_of(plain)
