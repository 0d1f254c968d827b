"""Results arrive at fixed steps, in order, however the threads run."""

import threading
import time
from contextlib import closing

import pytest

from crowdsim.crowd.search.worker_pool import WorkerPool


@pytest.mark.parametrize("workers", [1, 2, 4])
def test_results_come_out_by_due_step_and_key_whatever_finishes_first(workers: int) -> None:
    with closing(WorkerPool(workers, latency=3)) as pool:
        for step, key, pause in [(0, 5, 0.05), (0, 2, 0.0), (1, 1, 0.0)]:
            pool.submit(step, key, lambda key=key, pause=pause: (time.sleep(pause), key * 10)[1])
        assert pool.collect(2) == []
        assert pool.collect(3) == [(2, 20), (5, 50)]
        assert pool.collect(3) == []
        assert pool.collect(9) == [(1, 10)]


def test_jobs_run_on_other_threads_and_their_errors_come_back() -> None:
    def fail() -> int:
        raise ValueError(threading.current_thread().name)

    with closing(WorkerPool(1, latency=1)) as pool:
        pool.submit(0, 0, fail)
        with pytest.raises(ValueError, match="crowdsim"):
            pool.collect(1)


def test_nonsense_sizes_are_refused() -> None:
    with pytest.raises(ValueError, match="at least 1"):
        WorkerPool(0, 1)
    with pytest.raises(ValueError, match="at least 1"):
        WorkerPool(1, 0)


def test_settling_waits_for_all_jobs_and_leaves_their_results_due_when_they_were() -> None:
    done = []
    with closing(WorkerPool(2, latency=5)) as pool:
        for key in range(3):
            pool.submit(0, key, lambda key=key: (time.sleep(0.02), done.append(key), key)[2])
        pool.settle()
        assert sorted(done) == [0, 1, 2]
        assert pool.collect(4) == []
        assert pool.collect(5) == [(0, 0), (1, 1), (2, 2)]
        pool.settle()
