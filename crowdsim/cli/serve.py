"""``crowdsim serve``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from crowdsim.cli.errors_shown import Terminated
from crowdsim.cli.options import Debug, Overrides, Scenario
from crowdsim.errors import CrowdSimError
from crowdsim.whole_files import require_writable

if TYPE_CHECKING:
    from crowdsim.crowd.simulation import Simulation


def serve(
    scenario: Scenario,
    port: Annotated[int, typer.Option("--port", min=0, max=65535, help="Port of the page; 0 for any free one.")] = 8765,
    speed: Annotated[float, typer.Option("--speed", min=0.25, max=8.0, help="Times real time.")] = 1.0,
    record: Annotated[
        str | None,
        typer.Option(
            "--record", metavar="RUN.h5", help="Record the session; RUN.yaml beside it gives the same run again."
        ),
    ] = None,
    open_page: Annotated[bool, typer.Option("--open", help="Open the page in the browser.")] = False,
    host: Annotated[
        str, typer.Option("--host", help="Address to listen at; at the default one, only this machine can connect.")
    ] = "127.0.0.1",
    workers: Annotated[int, typer.Option("--workers", min=1, help="Threads that search motion or steer.")] = 2,
    overrides: Overrides = None,
    debug: Debug = False,
) -> None:
    """Simulate a scenario live: watch it in the browser, send people elsewhere, move things, until Ctrl-C."""
    from crowdsim.cli.progress import RunProgress
    from crowdsim.scenario.loader import load_scenario

    _require_websockets()
    loaded = load_scenario(scenario, overrides or [])
    file = None if record is None else Path(record)
    if file is not None:
        _require_names(file, scenario)

    with RunProgress(loaded.name) as progress:
        from crowdsim.crowd.simulation import Simulation

        simulation = Simulation(loaded, workers=workers, preparing=progress.maps)
    with simulation:
        ended, steps, late = _serve(simulation, file, (host, port), speed, open_page)
    # Only a signal ends a session, so the command always ends as one that was interrupted.
    done = f"{steps} steps, {late} of them late"
    if file is not None and steps:
        saved = simulation.save_scenario(file.with_suffix(".yaml"))
        done = f"{done}; wrote {file} and {saved[-1]}, whose run gives the same states"
    what = "terminated" if isinstance(ended, Terminated) else "interrupted"
    raise type(ended)(f"{what} after {done}")


def _serve(
    simulation: Simulation, file: Path | None, address: tuple[str, int], speed: float, open_page: bool
) -> tuple[KeyboardInterrupt, int, int]:
    """Run and serve until a signal comes; return its exception, and the numbers of steps and of late steps.

    ``file`` is the recording to write, or None; ``address`` is host and port; ``speed`` is a multiple of real time.
    """
    from crowdsim.cli.progress import Interruption
    from crowdsim.live.opening import pack_opening
    from crowdsim.live.page import live_page
    from crowdsim.live.server import Server
    from crowdsim.live.session import Session

    with Interruption() as interruption:
        page, opening = live_page(simulation.header.scenario_name), pack_opening(simulation)
        with Server(page, opening, *address) as server:
            session = Session(simulation, server, lambda: interruption.asked is not None, speed)
            server.ask = session.ask
            typer.echo(server.address)
            typer.echo("open this address in a browser; Ctrl-C ends the simulation", err=True)
            if open_page:
                typer.launch(server.local_address)
            session.step_until_stopped(file)
    assert interruption.asked is not None
    return interruption.asked, session.steps, session.late


def _require_names(file: Path, scenario: str) -> None:
    """Raise CrowdSimError if the recording or the scenario beside it cannot be written, or replaces ``scenario``."""
    from crowdsim.export.recording_names import require_not_the_scenario, require_recording_name

    beside = file.with_suffix(".yaml")
    require_recording_name(file)
    require_writable(beside)
    require_not_the_scenario(beside, scenario)


def _require_websockets() -> None:
    """Refuse to start without the package websockets, which is an extra."""
    try:
        import websockets  # noqa: F401
    except ImportError:
        raise CrowdSimError("crowdsim serve needs websockets: pip install 'crowdsim[live]'") from None
