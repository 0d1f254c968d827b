"""``crowdsim validate``."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Annotated, Literal

import typer

from crowdsim.cli.options import Debug, Json

FAILED = 4
"""Exit code if a test failed."""


def validate(
    names: Annotated[list[str] | None, typer.Argument(metavar="[NAME]...", help="Tests to run [default: all].")] = None,
    seeds: Annotated[
        int, typer.Option(min=1, max=1000, help="Number of runs of every scenario, with seeds from 1 on.")
    ] = 1,
    jobs: Annotated[int, typer.Option(min=1, max=256, help="Number of runs at a time, each in its own process.")] = 2,
    locomotion: Annotated[Literal["auto", "steered"], typer.Option(help="How the agents of all groups move.")] = "auto",
    page: Annotated[
        Path | None, typer.Option("--html", metavar="OUT.html", help="Write a report with pictures.")
    ] = None,
    markdown: Annotated[
        Path | None,
        typer.Option(
            metavar="OUT.md", help="Write the tables as a page of Markdown, and its pictures to images/OUT beside it."
        ),
    ] = None,
    listed: Annotated[bool, typer.Option("--list", help="List the tests, and why others are not run.")] = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Run tests of evacuation guidelines and measured diagrams; the exit code is 4 if any fails."""
    from crowdsim.cli.progress import WHOLE_RUN, FirstRunElsewhere, progress_bar
    from crowdsim.cli.tables import print_rows, print_table
    from crowdsim.errors import CrowdSimError
    from crowdsim.validate import report
    from crowdsim.validate.running import run_tests
    from crowdsim.validate.suite import MISSING, TESTS, find_tests
    from crowdsim.whole_files import require_writable, whole_file
    from crowdsim.yamlfile.messages import nearest

    if listed:
        if as_json:
            typer.echo(json.dumps({test.name: f"{test.title} ({test.source})" for test in TESTS}))
            return
        print_table([(test.name, f"{test.title} ({test.source})") for test in TESTS])
        typer.echo()
        print_table([(missing.source, f"{missing.title}: {missing.reason}") for missing in MISSING])
        return
    known = [test.name for test in TESTS]
    for name in names or ():
        if name not in known:
            raise CrowdSimError(f"there is no test '{name}'; {nearest(name, known, 'the tests are')}")

    # Refuse output files that cannot be written before running all tests.
    for file, suffix in ((page, ".html"), (markdown, ".md")):
        if file is not None:
            require_writable(file)
            if file.suffix != suffix:
                raise CrowdSimError(f"cannot write {file}: its name has to end with {suffix}")

    bar = progress_bar(WHOLE_RUN)
    task = bar.add_task("validating", total=None)

    def progress(done: int, total: int, what: str) -> None:
        """Show how many runs are done, and print a line for the one that has just ended."""
        bar.update(task, completed=done, total=total)
        bar.console.print(f"{done} of {total}: {what}", markup=False, highlight=False, soft_wrap=True)

    with tempfile.TemporaryDirectory() as folder:
        with bar, FirstRunElsewhere(bar):
            outcomes = run_tests(
                find_tests(names or []),
                range(1, seeds + 1),
                locomotion,
                jobs=jobs,
                pictures=None if page is None and markdown is None else Path(folder),
                progress=progress,
            )
        if page is not None:
            with whole_file(page, (".html",), "reports") as written:
                written.write_text(report.as_html(outcomes, locomotion, Path(folder)), encoding="utf-8")
        if markdown is not None:
            pictures = markdown.parent / "images" / markdown.stem
            pictures.mkdir(parents=True, exist_ok=True)
            for outcome in outcomes:
                name = f"{outcome.test.name}.png"
                with whole_file(pictures / name, (".png",), "pictures") as written:
                    written.write_bytes((Path(folder) / name).read_bytes())
            with whole_file(markdown, (".md",), "tables") as written:
                written.write_text(report.as_markdown(outcomes, locomotion, markdown), encoding="utf-8")
    if as_json:
        typer.echo(json.dumps(report.as_json(outcomes, locomotion)))
    else:
        print_rows(report.rows_of(outcomes))
        named = {
            verdict: ", ".join(outcome.test.name for outcome in outcomes if outcome.verdict == verdict)
            for verdict in ("departs", "failed")
        }
        typer.echo(
            f"\n{sum(outcome.passed for outcome in outcomes)} of {len(outcomes)} tests passed"
            + (f"; on purpose outside of its guideline: {named['departs']}" if named["departs"] else "")
            + (f"; failed: {named['failed']}" if named["failed"] else "")
        )
    if any(outcome.verdict == "failed" for outcome in outcomes):
        raise typer.Exit(FAILED)
