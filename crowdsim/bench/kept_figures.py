"""Figures of benchmarks kept from commit to commit: one CSV file for each machine, so that a slowdown is seen."""

from __future__ import annotations

import csv
import math
import re
import subprocess
from pathlib import Path

from crowdsim.bench.registry import BenchResult
from crowdsim.errors import CrowdSimError
from crowdsim.whole_files import whole_file

COLUMNS = ("benchmark", "figure", "date", "commit", "value", "python", "numba", "load")
"""Columns of the file. ``date`` is the day of the commit; units are in the names of figures. ``load`` is the load
average of the machine in the minute before, a number of processes that ran or waited, empty if it is not known: times
taken on a busy machine are too long."""


def keep_figures(result: BenchResult, folder: Path) -> Path:
    """Add the figures of a benchmark to the file of the machine that it ran on.

    Lines are sorted by benchmark, figure and date, so that each line stands below those of earlier days; lines of one
    day are sorted by commit. Figures of the same benchmark and commit are replaced.

    Parameters
    ----------
    result : BenchResult
        What was measured.
    folder : Path
        Where the file of the machine is, or is made, for example ``docs/figures``.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    CrowdSimError
        If the folder is in no git repository with a commit, or its file is no such table.
    """
    commit, date = _commit(folder)
    file = folder / f"{machine_name(result)}.csv"
    kept = [row for row in _rows(file) if (row["benchmark"], row["commit"]) != (result.name, commit)]
    load = "" if math.isnan(result.load) else f"{result.load:.1f}"
    same = {"benchmark": result.name, "date": date, "commit": commit, "load": load}
    # The file has columns for these two versions only; a result knows those of other libraries, too.
    versions = {name: result.versions[name] for name in ("python", "numba")}
    kept += [{**same, "figure": name, "value": f"{value:.6g}", **versions} for name, value in result.figures.items()]
    kept.sort(key=lambda row: (row["benchmark"], row["figure"], row["date"], row["commit"]))
    with whole_file(file, (".csv",), "figures") as written, written.open("w", encoding="utf-8", newline="") as out:
        table = csv.DictWriter(out, COLUMNS, lineterminator="\n")
        table.writeheader()
        table.writerows(kept)
    return file


def machine_name(result: BenchResult) -> str:
    """Return a name of the machine for files: its processor and the number of cores in use."""
    # Without trade marks, clock rate and filler words.
    processor = re.sub(r"\((r|tm)\)|@.*|\b(cpu|processor)\b", " ", str(result.machine["processor"]).lower())
    words = re.findall(r"[a-z0-9]+", processor)
    return "-".join([*words, str(result.machine["cores"]), "cores"])


def _rows(file: Path) -> list[dict[str, str]]:
    """Return the lines of a file, by COLUMNS; none if there is no file yet. Raise CrowdSimError for another table."""
    if not file.exists():
        return []
    with file.open(encoding="utf-8", newline="") as lines:
        table = csv.DictReader(lines)
        # Files of earlier versions have no load.
        if tuple(table.fieldnames or ()) not in (COLUMNS, COLUMNS[:-1]):
            raise CrowdSimError(f"{file}: the first line must be {','.join(COLUMNS)}; move the file away, or mend it")
        return [{"load": "", **row} for row in table]


def _commit(folder: Path) -> tuple[str, str]:
    """Return the commit that is checked out, with a ``+`` if files other than .csv differ from it, and its date.

    Raise CrowdSimError if ``folder`` does not exist, or is in no repository with a commit.
    """
    if not folder.is_dir():
        raise CrowdSimError(f"the folder {folder} does not exist; make it first")
    try:
        line = _git(folder, "log", "-1", "--format=%h %cs")
        # Files of figures do not count: several benchmarks are kept one after the other.
        changed = _git(folder, "status", "--porcelain", "--untracked-files=no", ":/", ":(exclude,top,glob)**/*.csv")
    except (OSError, subprocess.CalledProcessError) as error:
        raise CrowdSimError(f"{folder} is in no git repository with a commit; figures are kept by commit") from error
    commit, date = line.split()
    return commit + ("+" if changed else ""), date


def _git(folder: Path, *arguments: str) -> str:
    """Return what git prints in ``folder``; raise CalledProcessError if it fails."""
    return subprocess.run(
        ["git", "-C", str(folder), *arguments], check=True, capture_output=True, text=True
    ).stdout.strip()
