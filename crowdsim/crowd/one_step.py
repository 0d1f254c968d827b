"""One step of a simulation at a time: neither two threads nor a callback may take one within another."""

from __future__ import annotations

import threading

from crowdsim.errors import CrowdSimError


class OneStep:
    """A block that is entered by one caller at a time.

    Parameters
    ----------
    name : str
        Name of the scenario, for the message.

    Raises
    ------
    CrowdSimError
        On entering, while another one is inside, in this thread or another.
    """

    def __init__(self, name: str) -> None:
        self._name, self._lock = name, threading.Lock()

    def __enter__(self) -> None:
        if not self._lock.acquire(blocking=False):
            raise CrowdSimError(
                f"{self._name}: a step is being taken, by run() or in another thread; take steps in one thread, one "
                "after the other, and give only commands in what run() calls"
            )

    def __exit__(self, *_: object) -> None:
        self._lock.release()
