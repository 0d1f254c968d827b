"""Show a recording in a window: play, pause, seek."""

from __future__ import annotations

import time as clock

from crowdsim.playback.scene import Scene
from crowdsim.recording.reader import Recording

_TICK_MILLISECONDS = 16
"""Time between two pictures [ms]: about 60 a second."""


class Player:
    """The clock of a window: ``time`` runs from 0 to ``duration`` [s] while ``playing``, and stops there."""

    def __init__(self, duration: float) -> None:
        self.duration = duration
        self.time = 0.0
        self.playing = True

    def toggle(self) -> None:
        """Pause or continue; at the end, start again."""
        if not self.playing and self.time >= self.duration:
            self.time = 0.0
        self.playing = not self.playing

    def seek(self, time: float) -> None:
        """Go to ``time`` [s], clipped to the recording."""
        self.time = min(max(time, 0.0), self.duration)

    def advance(self, seconds: float) -> None:
        """Let ``seconds`` pass, and pause at the end; do nothing during a pause."""
        if self.playing:
            self.seek(self.time + seconds)
            self.playing = self.time < self.duration


def window(
    recording: Recording,
    view: str = "overview",
    agent: int | None = None,
    size: tuple[int, int] = (1280, 720),
    color_by: str = "behavior",
    paths: bool = True,
) -> None:
    """Open a window on ``recording`` and return when it is closed.

    Space plays and pauses, the arrow keys go a second back and forth, the slider anywhere; the mouse turns the camera.

    Parameters
    ----------
    recording : Recording
        What is shown; it stays open.
    view : str
        ``overview``, ``top``, or ``follow``, which needs an ``agent``.
    agent : int or None
        Number of the agent that the camera follows.
    size : (int, int)
        Width and height in pixels.
    color_by : str
        ``behavior``, ``group``, ``agent``, ``level`` (captured or steered), or the name of an attribute.
    paths : bool
        Whether planned paths are drawn on the floor.

    Raises
    ------
    CrowdSimError
        If a view, agent, size or coloring is invalid.
    DrawingUnavailable
        If there is no display.
    """
    scene = Scene(recording, size, color_by, interactive=True, paths=paths)
    try:
        _play(scene, Player(recording.duration), view, agent)
    finally:
        scene.close()


def _play(scene: Scene, player: Player, view: str, agent: int | None) -> None:
    """Show the scene until its window is closed, with a slider for the time, and keys to pause and seek.

    The view ``follow`` moves with its ``agent``; in other views the mouse turns the camera.
    """
    plotter = scene.plotter
    scene.look(view, 0.0, agent)
    scene.show_time(0.0)
    slider = plotter.add_slider_widget(
        player.seek,
        (0.0, max(player.duration, 1e-3)),  # a slider needs a range
        value=0.0,
        title="seconds",
        pointa=(0.3, 0.06),
        pointb=(0.97, 0.06),
        style="modern",
        interaction_event="always",
    )
    shown = -1.0  # no time of the recording, so that the first tick draws
    before: float | None = None  # no tick yet: opening the window may take seconds, of which nothing is skipped

    def tick(_step: int) -> None:
        """Advance by the time that has passed since the last tick; draw only if the shown time has changed."""
        nonlocal shown, before
        now = clock.perf_counter()
        if before is not None:
            player.advance(now - before)
        before = now
        if player.time == shown:
            return
        shown = player.time
        if view == "follow":
            scene.look(view, shown, agent)
        scene.show_time(shown)
        slider.GetRepresentation().SetValue(shown)
        plotter.render()

    plotter.add_key_event("space", player.toggle)
    plotter.add_key_event("Left", lambda: player.seek(player.time - 1.0))
    plotter.add_key_event("Right", lambda: player.seek(player.time + 1.0))
    # As many ticks as an int holds: they last a year.
    plotter.add_timer_event(max_steps=2**31 - 1, duration=_TICK_MILLISECONDS, callback=tick)
    plotter.show(auto_close=False)
