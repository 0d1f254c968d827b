"""``crowdsim run``, ``crowdsim check`` and ``crowdsim recover``."""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from crowdsim.cli.errors_shown import Terminated
from crowdsim.cli.options import Debug, Json, Overrides, Scenario
from crowdsim.errors import CrowdSimError
from crowdsim.whole_files import require_writable, whole_file

_MOST_NOTES = 4
"""Largest number of notes about captures that a run prints."""


def run(
    scenario: Scenario,
    output: Annotated[
        str | None, typer.Option("--output", "-o", metavar="FILE", help="Recording to write [default: NAME.h5 here].")
    ] = None,
    seed: Annotated[int | None, typer.Option("--seed", min=0, help="Replace the scenario's seed.")] = None,
    workers: Annotated[
        int, typer.Option("--workers", min=1, help="Threads that search motion; the result never depends on it.")
    ] = 2,
    page: Annotated[
        bool, typer.Option("--page", help="Also write a page that plays the recording in any browser.")
    ] = False,
    overrides: Overrides = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Simulate a scenario, record it, and print a summary."""
    from crowdsim.cli.progress import RunProgress
    from crowdsim.cli.summary import tell_summary
    from crowdsim.crowd.ranks.launch import launched_ranks
    from crowdsim.scenario.loader import load_scenario

    changes = [*(overrides or [])]
    if seed is not None:
        changes.append(f"seed={seed}")
    if launched_ranks() > 1:
        from crowdsim.cli.study_commands.ranked import run_on_ranks

        run_on_ranks(scenario, changes, partial(_output_file, output), page, as_json, workers)
        return
    loaded = load_scenario(scenario, changes)
    file = _output_file(output, loaded.name)
    page_file = file.with_suffix(".html")
    if page:
        require_writable(page_file)

    # What an interruption leaves, for its message.
    left = f"{file} was not written"
    with RunProgress(loaded.name) as progress:
        from crowdsim.crowd.simulation import Simulation

        try:
            simulation = Simulation(loaded, workers=workers, preparing=progress.maps)
            _tell(simulation.notes)
            progress.begin_steps()
            with simulation.run(file, progress=progress.step) as recording:
                left = f"{file} was written" + (f", {page_file} was not" if page else "")
                progress.end_steps()
                summary = {**recording.summary, "recording": str(file)}
                if page:
                    from crowdsim.export.page.page import write_page

                    write_page(recording, page_file)
                    summary["page"] = str(page_file)
        except KeyboardInterrupt as stop:
            what = "terminated" if isinstance(stop, Terminated) else "interrupted"
            raise type(stop)(f"{what} at step {progress.steps_done}; {left}") from None

    tell_summary(summary, as_json)


def _output_file(output: str | None, name: str) -> Path:
    """Return the file of a recording: ``output``, or by default ``name``.h5, of the scenario's name.

    Raise CrowdSimError if it cannot be written, or has the ending of another kind of file.
    """
    from crowdsim.export.recording_names import require_recording_name

    file = Path(output if output is not None else f"{_file_name(name)}.h5")
    require_recording_name(file)
    return file


def _tell(notes: Sequence[str]) -> None:
    """Print up to _MOST_NOTES notes on captures, and how many more there are.

    Notes on motions that were made of captures ("made ...") come first.
    """
    first = sorted(notes, key=lambda note: not note.startswith("made"))
    for note in first[:_MOST_NOTES]:
        typer.echo(f"note: {note}", err=True)
    if len(notes) > _MOST_NOTES:
        typer.echo(f"note: {len(notes) - _MOST_NOTES} more; see all with: crowdsim motion info FOLDER", err=True)


def _file_name(name: str) -> str:
    """Return a scenario's name without characters that lead to another folder."""
    return name.replace("/", "-").replace("\\", "-")


def check(
    scenario: Scenario,
    picture: Annotated[
        Path | None,
        typer.Option(metavar="OUT.png", help="Draw each layer with starts, goals and the area each behavior reaches."),
    ] = None,
    overrides: Overrides = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Report everything that is wrong with a scenario, without running it."""
    from dataclasses import asdict

    from crowdsim.cli.progress import progress_bar
    from crowdsim.crowd.state.assets import load_behaviors, require_usable
    from crowdsim.scenario.check import check_scenario, check_ways
    from crowdsim.scenario.loader import load_scenario

    try:
        with progress_bar() as bar:
            task = bar.add_task(f"{scenario}: reading", total=None)  # meshes of thousands of parts take a while

            def parts(done: int, total: int) -> None:
                """Show how many parts of meshes are on the layers."""
                bar.update(task, completed=done, total=total, description=f"{scenario}: parts on the layers")

            loaded = load_scenario(scenario, overrides or [], parts)
            bar.update(task, completed=0, total=None, description=f"{scenario}: behaviors")
            motion = load_behaviors(loaded)
            require_usable(motion, loaded)
            warnings = [*check_scenario(loaded), *check_ways(loaded, motion.behaviors)]
            notes = [*loaded.environment.report, *motion.notes]
    except CrowdSimError as error:
        if not as_json:
            raise
        # Errors of scenario files list all problems; other errors are one message.
        problems = [asdict(problem) for problem in getattr(error, "problems", ())] or [{"message": str(error)}]
        typer.echo(json.dumps({"ok": False, "errors": problems, "warnings": [], "notes": []}))
        raise typer.Exit(error.exit_code) from None
    if picture is not None:
        from crowdsim.figures import write_figure
        from crowdsim.scenario.picture import draw_scenario

        write_figure(draw_scenario(loaded, motion.behaviors), picture)
    if as_json:
        typer.echo(json.dumps({"ok": True, "errors": [], "warnings": warnings, "notes": notes}))
        return
    for note in notes:
        typer.echo(f"note: {note}")
    for warning in warnings:
        typer.echo(f"warning: {warning}")
    typer.echo(f"{loaded.name}: ok")


def recover(
    part: Annotated[Path, typer.Argument(metavar="FILE.part", help="File that a killed run left.")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE", help="Recording to write [default: FILE].")
    ] = None,
    debug: Debug = False,
) -> None:
    """Make a recording from the file that a killed run left. If the run had commands, also write its scenario."""
    from crowdsim.recording.recovery import recover as recover_part

    with recover_part(part, output) as recording:
        what = (
            "all of its run" if recording.complete else f"the first {recording.duration:g} s of a run that was killed"
        )
        typer.echo(f"{recording.path}: {recording.steps} steps, {what}")
        beside = recording.path.with_suffix(".yaml")
        if recording.commands and not beside.exists():
            with whole_file(beside, (".yaml",), "scenarios") as written:
                written.write_text(recording.scenario_yaml(), encoding="utf-8")
            typer.echo(
                f"{beside}: its scenario with {len(recording.commands)} commands, whose run gives the same states"
            )
