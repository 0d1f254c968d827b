"""``crowdsim doctor``."""

from __future__ import annotations

import json
from typing import Any

import typer

from crowdsim.cli.options import Debug, Json


def doctor(as_json: Json = False, debug: Debug = False) -> None:
    """Show what crowdsim finds on this machine, and what to install if something is missing."""
    from crowdsim.cli.tables import print_table

    findings = examine()
    if as_json:
        typer.echo(json.dumps(findings))
        return
    rows = [(name, str(value)) for name, value in findings["machine"].items()]
    rows += [("threads", f"{findings['numba']['threads']}, threading layer {findings['numba']['threading_layer']}")]
    cache = findings["kernel_cache"]
    rows += [("kernel cache", f"{cache['folder']}{' (empty: the first run compiles)' if cache['cold'] else ''}")]
    drawing = findings["drawing"]
    rows += [("drawing", drawing["backend"] or f"none. {drawing['remedy']}")]
    mpi = findings["mpi"]
    rows += [("several processes", mpi["remedy"] or f"{mpi['library']}, {mpi['mpiexec']}")]
    rows += list(findings["versions"].items())
    print_table(rows)


def examine() -> dict[str, Any]:
    """Return machine, versions, numba's threads, the kernel cache, the drawing backend and MPI."""
    from crowdsim import jit
    from crowdsim.bench.machine import describe_machine, describe_versions
    from crowdsim.crowd.ranks.launch import try_mpi

    return {
        "machine": describe_machine(),
        "versions": describe_versions(),
        "numba": _threads(),
        "kernel_cache": {"folder": str(jit.cache_folder()), "cold": jit.is_cold()},
        "drawing": _drawing(),
        "mpi": try_mpi()._asdict(),
    }


def _threads() -> dict[str, Any]:
    """Return the number of numba's threads, and the threading layer that runs them."""
    import numba
    from numba.np.ufunc.parallel import _launch_threads  # numba chooses the layer only when threads start

    _launch_threads()
    return {"threads": numba.get_num_threads(), "threading_layer": numba.threading_layer()}


def _drawing() -> dict[str, Any]:
    """Return ``backend``, with which pictures are drawn, and ``remedy``, what to install; one of both is None."""
    from crowdsim.errors import DrawingUnavailable
    from crowdsim.playback.drawing_backend import find_backend

    try:
        return {"backend": find_backend().name, "remedy": None}
    except DrawingUnavailable as error:
        return {"backend": None, "remedy": str(error)}
