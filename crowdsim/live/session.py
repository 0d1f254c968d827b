"""The clock of a live simulation: paces its steps, carries out requests between them, and publishes each step."""

from __future__ import annotations

import queue
import time
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Any, Protocol

from crowdsim.crowd.simulation import Simulation
from crowdsim.live.commands import command
from crowdsim.live.pictures import picture, picture_columns, text, things
from crowdsim.live.requests import Pause, Request, RequestRefused, SetSpeed, Step

MOST_WAITING = 256
"""Largest number of requests that wait for the end of a step."""

_LOOK = 0.05
"""Longest time between two checks whether the session is to end [s]."""
_LOST = 0.5
"""Largest delay of a step that is caught up by faster steps [s]; after a larger one, the clock starts anew."""
_ENDED = "the simulation has ended; start 'crowdsim serve' again"

Answer = Future[dict[str, Any]]


class Publisher(Protocol):
    """Receiver of what a session publishes; its methods return at once."""

    def picture(self, content: bytes) -> None:
        """Publish a picture of the agents in a step."""

    def things(self, message: str) -> None:
        """Publish doors and movables as they are now."""

    def state(self, message: str) -> None:
        """Publish pause, speed, end, and the groups that can be added to."""


class Session:
    """One live simulation. All methods but :meth:`ask` run in the thread that steps it.

    Parameters
    ----------
    simulation : Simulation
        The simulation.
    publisher : Publisher
        Receives every step.
    stopped : callable
        Returns True when the session is to end.
    speed : float
        Speed of the simulation, as a multiple of real time.

    Attributes
    ----------
    steps, late : int
        Steps taken, and how many of them were not done when the next one was due.
    """

    def __init__(
        self, simulation: Simulation, publisher: Publisher, stopped: Callable[[], bool], speed: float = 1.0
    ) -> None:
        self.simulation = simulation
        self.steps = self.late = 0
        self._publisher = publisher
        self._stopped = stopped
        self._speed = speed
        self._paused = False
        self._single = False  # whether to take one step although it is paused
        self._requests: queue.Queue[tuple[Request, Answer]] = queue.Queue(MOST_WAITING)
        self._columns = picture_columns(simulation.header.motion)
        self._told_state = ""
        self._placings: list[Any] | None = None
        # When the next step is due [s]; None while the simulation stands.
        self._due: float | None = None
        self._ended = False

    def ask(self, request: Request) -> Answer:
        """Queue a request, from any thread; return the future of its answer, which comes between two steps.

        The future may hold RequestRefused instead.
        """
        answer: Answer = Future()
        try:
            self._requests.put_nowait((request, answer))
        except queue.Full:
            answer.set_exception(RequestRefused("too many requests wait; try again"))
        if self._ended:  # perhaps while the request was queued: no step takes it any more
            self._refuse_all()
        return answer

    def step_until_stopped(self, output: Path | None) -> None:
        """Take steps until the session is stopped, and record it if ``output`` is given and a step was taken."""
        try:
            # A recording needs at least one step, so `run` is called only when the first step is due. It calls `until`
            # before each step: the first call must not wait again, and returns False, so that the step is taken.
            if not self._wait(self.simulation):
                first = [False]
                recording = self.simulation.run(output, until=lambda each: first.pop() if first else self._wait(each))
                if recording is not None:
                    recording.close()
        finally:
            self._ended = True
            self._refuse_all()

    def _refuse_all(self) -> None:
        """Refuse all queued requests, as no step will come."""
        while True:
            try:
                _, answer = self._requests.get_nowait()
            except queue.Empty:
                return
            if answer.set_running_or_notify_cancel():
                answer.set_exception(RequestRefused(_ENDED))

    def _wait(self, simulation: Simulation) -> bool:
        """Wait until the next step is due, and carry out requests meanwhile.

        Return False if the step is to be taken now, True if the session is to end.
        """
        self._publish()
        now = time.perf_counter()
        if self._due is not None:
            # A step has been taken. The next one is due a period later, or at once after a delay that is not caught up.
            self.steps += 1
            self._due += self._period
            self.late += now > self._due
            if now > self._due + _LOST:
                self._due = now
        while not self._stopped():
            # Stand while no step has anything to do, or while paused, unless a single step was requested.
            held = simulation.finished or (self._paused and not self._single)
            if held:
                self._due = None
                self._single = False
            elif self._due is None:
                self._due = time.perf_counter()
            self._publish_state()
            wait = _LOOK if self._due is None else min(self._due - time.perf_counter(), _LOOK)
            # Queued requests go first; without any, a step that is due is taken.
            if not self._carry_out_one(max(wait, 0.0)) and self._due is not None and time.perf_counter() >= self._due:
                self._single = False
                return False
        return True

    @property
    def _period(self) -> float:
        """Return the time from step to step [s]."""
        return 1.0 / (self.simulation.scenario.steps_per_second * self._speed)

    def _carry_out_one(self, wait: float) -> bool:
        """Carry out the next queued request; return False if none comes within ``wait`` [s]."""
        try:
            request, answer = self._requests.get(timeout=wait) if wait > 0.0 else self._requests.get_nowait()
        except queue.Empty:
            return False
        # The page may have gone meanwhile, and its request been canceled: then do nothing.
        if not answer.set_running_or_notify_cancel():
            return True
        try:
            words = self._obey(request)
        except RequestRefused as refused:
            answer.set_exception(refused)
        else:
            answer.set_result({"words": words, "step": self.simulation.step_count})
        return True

    def _obey(self, request: Request) -> str:
        """Carry out a request; return in words what it does."""
        match request:
            case Pause():
                self._paused = request.paused
                return "paused" if request.paused else "goes on"
            case Step():
                self._paused = self._single = True
                return "one step"
            case SetSpeed():
                self._speed = request.speed
                return f"{request.speed:g} times real time"
        if self.simulation.step_count >= self.simulation.step_limit:
            raise RequestRefused(f"{self._over()}; give the scenario a longer 'duration'")
        return command(self.simulation, request)

    def _publish(self) -> None:
        """Publish a picture of the last step, and doors and movables if one came, moved or went."""
        simulation = self.simulation
        self._publisher.picture(picture(max(simulation.step_count - 1, 0), simulation.crowd.frame(), self._columns))
        placings = [placing for _, placing in simulation.movables()]
        if placings != self._placings:
            self._placings = placings
            self._publisher.things(text("things", things=things(simulation)))

    def _publish_state(self) -> None:
        """Publish pause, speed, end and the groups that can be added to, if any of them changed."""
        simulation, over = self.simulation, ""
        if simulation.finished:
            over = self._over()
        state = text("state", paused=self._paused, speed=self._speed, over=over, on_call=simulation.on_call())
        if state != self._told_state:
            self._told_state = state
            self._publisher.state(state)

    def _over(self) -> str:
        """Return in words why no more steps are taken."""
        if self.simulation.step_count >= self.simulation.step_limit:
            return f"the {self.simulation.scenario.duration:g} s of the scenario are over"
        crowd = self.simulation.crowd
        missing = int(crowd.expected.sum()) - crowd.arrived
        if missing:
            return f"{missing} find no way; open one, or send or add agents, and it goes on"
        return "all have arrived; send or add agents, and it goes on"
