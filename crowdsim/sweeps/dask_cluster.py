"""Run points on Dask: a cluster of this machine, or the one of a scheduler; it replaces workers that die."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from crowdsim.errors import CrowdSimError
from crowdsim.sweeps.engine import engine
from crowdsim.sweeps.points import Point
from crowdsim.sweeps.processes import DIED
from crowdsim.sweeps.running import Keep, Outcome, Runner

try:
    import distributed
except ImportError:
    raise CrowdSimError("--dask needs Dask distributed; install it with: pip install 'crowdsim[sweep]'") from None

_NAME = "crowdsim-runner"

_PATIENCE = "20s"
"""How long a scheduler may take to answer."""


class KeptRunner(distributed.WorkerPlugin):
    """Dask's plugin that makes a worker's runner, which keeps kernels, motion and maps between points.

    ``recordings`` and ``keep`` are those of :class:`crowdsim.sweeps.running.Runner`.
    """

    def __init__(self, recordings: Path | None, keep: Keep) -> None:
        self._recordings, self._keep = recordings, keep

    def setup(self, worker: Any) -> None:
        """Make the runner when a worker starts."""
        self.runner = Runner(self._recordings, self._keep)


def run_points_on_dask(
    points: Sequence[Point], address: str, jobs: int, recordings: Path | None, keep: Keep
) -> Iterator[tuple[Point, Outcome]]:
    """Run points on Dask; yield each point with its outcome as it is done, in any order.

    Parameters
    ----------
    points : sequence of Point
        Points to run.
    address : str
        Address of a scheduler, as ``tcp://host:8786``, or "local" for ``jobs`` workers on this machine.
    jobs : int
        Number of local workers.
    recordings : Path or None
        Folder for recordings, which all workers have to see; None for a temporary one.
    keep : Keep
        Which recordings stay.

    Raises
    ------
    CrowdSimError
        If there is no scheduler at the address.
    """
    with _client(address, jobs) as client:
        client.register_plugin(KeptRunner(recordings, keep), name=_NAME)
        futures = {
            client.submit(run_here, point, engine(), key=f"crowdsim-{point.name}", pure=False): point
            for point in points
        }
        for future in distributed.as_completed(list(futures)):
            try:
                outcome = future.result()
            except distributed.KilledWorker:
                outcome = Outcome({}, DIED, lasting=False)
            except Exception as error:  # an error of Dask: errors of runs are outcomes
                outcome = Outcome({}, f"Dask: {type(error).__name__}: {error}", lasting=False)
            yield futures[future], outcome
            future.release()


def run_here(point: Point, wanted: str) -> Outcome:
    """Run a point in the Dask worker that calls this; the outcome is an error if its engine is not ``wanted``.

    ``wanted`` is what :func:`engine` returns in the process that submits the point.
    """
    if engine() != wanted:
        where = distributed.get_worker().address
        return Outcome(
            {}, f"the worker {where} has crowdsim {engine()}, not {wanted}; give all the same", lasting=False
        )
    runner: Runner = distributed.get_worker().plugins[_NAME].runner
    return runner.run(point)


def _client(address: str, jobs: int) -> Any:
    """Return a client of the scheduler at ``address``, or of ``jobs`` processes started here for ``local``.

    Raise CrowdSimError if there is no scheduler.
    """
    if address == "local":
        # Without a page that shows its work, and without its messages (50: only critical ones).
        cluster = distributed.LocalCluster(
            n_workers=jobs, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
        )
        return _LocalClient(cluster)
    try:
        return distributed.Client(address, timeout=_PATIENCE)
    except (OSError, ValueError) as error:
        raise CrowdSimError(
            f"--dask {address}: there is no scheduler ({error}); start one with: dask scheduler"
        ) from None


class _LocalClient:
    """A local cluster and its client, as a context; leaving it closes both."""

    def __init__(self, cluster: Any) -> None:
        self._cluster, self._client = cluster, distributed.Client(cluster)

    def __enter__(self) -> Any:
        return self._client

    def __exit__(self, *_: object) -> None:
        self._client.close()
        self._cluster.close()
