"""RVO2 in the same run, if its sources are given, as a reference for the time of a step of many agents."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

from crowdsim.errors import CrowdSimError

_DRIVER = Path(__file__).with_name("rvo2_driver.cc")


class Rvo2:
    """RVO2, compiled from the sources in ``folder``, which contains ``src/RVO.h``, to a program in ``into``.

    Raises
    ------
    CrowdSimError
        If there are no sources or no C++ compiler, or they do not compile.
    """

    def __init__(self, folder: Path, into: Path) -> None:
        sources = sorted((folder / "src").glob("*.cc"))
        if not (folder / "src" / "RVO.h").is_file() or not sources:
            raise CrowdSimError(f"{folder} holds no sources of RVO2; give the folder of its repository, with src/RVO.h")
        compiler = shutil.which("c++") or shutil.which("g++") or shutil.which("clang++")
        if compiler is None:
            raise CrowdSimError("RVO2 has to be compiled, and there is no C++ compiler; install one, or drop --rvo2")
        self._program = into / "rvo2"
        command = [compiler, "-O3", "-march=native", "-flto", "-DRVO_STATIC_DEFINE", f"-I{folder / 'src'}"]
        done = subprocess.run(
            [*command, *map(str, sources), str(_DRIVER), "-o", str(self._program)], capture_output=True, text=True
        )
        if done.returncode:
            raise CrowdSimError(f"RVO2 in {folder} does not compile:\n{done.stderr[-2000:]}")

    def step_times(self, agents: int, density: float, steps: int) -> list[float]:
        """Return the time of each step on one thread, divided by the number of agents [us], at a density [1/m2].

        Raises
        ------
        subprocess.CalledProcessError
            If the program fails.
        """
        arguments = [str(self._program), str(agents), str(density), str(steps)]
        done = subprocess.run(arguments, capture_output=True, text=True, check=True)
        return [float(line) for line in done.stdout.split()]
