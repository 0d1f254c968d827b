"""Run all points of a sweep that are not done yet, and write its table and its picture."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from crowdsim.figures import write_figure
from crowdsim.sweeps.picture import draw_sweep
from crowdsim.sweeps.points import Point
from crowdsim.sweeps.processes import run_points
from crowdsim.sweeps.running import Keep, Outcome, is_kept
from crowdsim.sweeps.store import Store
from crowdsim.sweeps.table import Row, table_of, usual_figures
from crowdsim.whole_files import whole_file

Progress = Callable[[int, int, int], None]
"""Called as ``progress(done, all, failed)``."""


class Sweep(NamedTuple):
    """A finished sweep.

    Attributes
    ----------
    rows : tuple of (Point, Outcome)
        All points in their order.
    done_before : int
        Number of points that had been done by an earlier call, and are not run again.
    table, picture : Path
        ``sweep.csv`` and ``sweep.png``.
    """

    rows: tuple[Row, ...]
    done_before: int
    table: Path
    picture: Path

    @property
    def failed(self) -> int:
        """Return the number of points that failed."""
        return sum(bool(outcome.error) for _, outcome in self.rows)


def sweep(
    points: Sequence[Point],
    folder: Path,
    *,
    jobs: int = 1,
    keep: Keep = "none",
    dask: str | None = None,
    figures: Sequence[str] = (),
    progress: Progress | None = None,
    note: Callable[[str], None] | None = None,
) -> Sweep:
    """Run all points that are not done yet, each with one thread, and write ``sweep.csv`` and ``sweep.png``.

    Parameters
    ----------
    points : sequence of Point
        From :func:`~crowdsim.sweeps.points.points_of`.
    folder : Path
        Folder of the sweep; a sweep that was stopped goes on from it.
    jobs : int
        Number of processes at a time.
    keep : {"none", "recordings", "failures"}
        Recordings that stay in ``folder/recordings``: none, all, or those of runs in which not all arrive. Points
        that were done without keeping theirs are run again.
    dask : str or None
        Address of a Dask scheduler, or "local", to run the points there.
    figures : sequence of str
        Columns of the table to draw; by default times, flows, densities and speeds.
    progress : callable or None
        Called at the start, and whenever a point is done, with the numbers of points that are done, of all, and of
        those that failed.
    note : callable or None
        Called with a sentence if points are run again, because another state of crowdsim has run them, or because
        their recordings were not kept.

    Raises
    ------
    CrowdSimError
        If the folder cannot be used, or Dask is missing. An error of a run is in its row of the table.
    """
    with Store(folder) as store:
        found = {point: outcome for point in points if (outcome := store.done(point)) is not None}
        unkept = [
            point
            for point, outcome in found.items()
            if not outcome.error
            and is_kept(outcome.figures, keep)
            and not (store.recordings / f"{point.name}.h5").is_file()
        ]
        for point in unkept:
            del found[point]
        before = len(found)
        missing = [point for point in points if point not in found]

        def tell() -> None:
            """Report the points that are done and failed so far."""
            if progress is not None:
                progress(len(found), len(points), sum(bool(outcome.error) for outcome in found.values()))

        if store.outdated and note is not None:
            note(
                f"{store.outdated} points in {folder} are of another version or state of crowdsim; they are run again, "
                "so that all are of the same"
            )
        if unkept and note is not None:
            note(f"the recordings of {len(unkept)} points in {folder} were not kept; they are run again")
        tell()
        recordings = None if keep == "none" else store.recordings.resolve()
        for point, outcome in _outcomes(missing, jobs, recordings, keep, dask):
            store.keep(point, outcome)
            found[point] = outcome
            tell()
        rows = [(point, found[point]) for point in points]
        table, picture = folder / "sweep.csv", folder / "sweep.png"
        with whole_file(table, (".csv",), "tables") as written:
            written.write_text(table_of(rows), encoding="utf-8", newline="\n")
        write_figure(draw_sweep(rows, list(figures) or usual_figures(rows)), picture)
    return Sweep((*rows,), before, table, picture)


def _outcomes(
    points: Sequence[Point], jobs: int, recordings: Path | None, keep: Keep, dask: str | None
) -> Iterator[tuple[Point, Outcome]]:
    """Yield each point with its outcome, in any order, from processes here or from a cluster of Dask.

    ``recordings`` is the folder for recordings that stay; the other arguments are those of :func:`sweep`.
    """
    # Start no process and no cluster for nothing.
    if not points:
        return iter(())
    if dask is None:
        return run_points(points, jobs, recordings, keep)
    # Imported only here, as Dask is optional.
    from crowdsim.sweeps.dask_cluster import run_points_on_dask

    return run_points_on_dask(points, dask, jobs, recordings, keep)
