"""Jobs on threads whose results arrive at a fixed simulation step, so that thread timing has no effect.

The result of a job submitted in step s is returned in step s + latency, which waits for the job if it is not done by
then. Results due in the same step are returned in the order of their keys. So any number of workers gives the same run.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from typing import Generic, TypeVar

Result = TypeVar("Result")


class WorkerPool(Generic[Result]):
    """Threads that run pure functions built on GIL-free kernels.

    Parameters
    ----------
    workers : int
        Number of threads.
    latency : int
        Steps between a submission and the step that receives the result, at least 1.

    Raises
    ------
    ValueError
        If ``workers`` or ``latency`` is less than 1.
    """

    def __init__(self, workers: int, latency: int) -> None:
        if workers < 1 or latency < 1:
            raise ValueError("workers and latency must be at least 1")
        self.latency = latency
        self._threads = ThreadPoolExecutor(workers, thread_name_prefix="crowdsim")
        # Step in which each job is due, its key, and its result to come.
        self._pending: list[tuple[int, int, Future[Result]]] = []

    def submit(self, step: int, key: int, job: Callable[[], Result]) -> None:
        """Start ``job``; its result is due in step ``step + latency``. A key may have one pending job at most."""
        self._pending.append((step + self.latency, key, self._threads.submit(job)))

    def collect(self, step: int) -> list[tuple[int, Result]]:
        """Return (key, result) of every job due by ``step``, by due step and key; wait for them.

        If a job has raised an error, it is raised here.
        """
        due = sorted((entry for entry in self._pending if entry[0] <= step), key=lambda entry: entry[:2])
        self._pending = [entry for entry in self._pending if entry[0] > step]
        return [(key, future.result()) for _, key, future in due]

    def settle(self) -> None:
        """Wait until all jobs are done, so that their inputs may change; the steps in which results are due stay."""
        wait([future for _, _, future in self._pending])

    def close(self) -> None:
        """End the threads; jobs that have not begun are dropped. Closing twice does nothing."""
        self._threads.shutdown(wait=True, cancel_futures=True)
