"""Tracks of a recording as rows of a table: one row for each present agent and step."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.errors import RecordingError
from crowdsim.recording.columns import RecordedFile
from crowdsim.recording.header import AgentState

if TYPE_CHECKING:
    import pandas

TABLES_NEED = "tables need pandas; install it with: pip install 'crowdsim[table]'"

_STEPS_AT_ONCE = 64
"""Steps that are read at once: as many as a chunk of the file holds."""


class TrackRows(NamedTuple):
    """R rows, in order of time, then of agents.

    Attributes
    ----------
    agent, frame : (R,) int64
        Agent, and frame counted from the start of the run; ``frame / rate`` is the time [s].
    x, y, heading : (R,) float32
        Track pose [m], [rad].
    behavior : (R,) int8
        Index into the header's behaviors, -1 for none.
    state : (R,) int8
        An AgentState, never ABSENT.
    """

    agent: NDArray[np.int64]
    frame: NDArray[np.int64]
    x: NDArray[np.float32]
    y: NDArray[np.float32]
    heading: NDArray[np.float32]
    behavior: NDArray[np.int8]
    state: NDArray[np.int8]


def steps_a_frame(recording: RecordedFile, rate: float | None) -> int:
    """Return the number of recorded steps per frame at ``rate`` [1/s]; 1 if no rate is given.

    Raises
    ------
    RecordingError
        If the rate does not divide that of the recording, because nothing is interpolated.
    """
    recorded = recording.steps_per_second
    if rate is None:
        return 1
    rates = [recorded // every for every in range(recorded, 0, -1) if recorded % every == 0]
    if rate not in rates:
        raise RecordingError(
            f"{recording.path} has {recorded} steps a second; {rate:g} frames a second would need interpolation: "
            f"choose one of {', '.join(map(str, rates))}"
        )
    return recorded // int(rate)


def track_blocks(
    recording: RecordedFile,
    every: int = 1,
    first: int = 0,
    end: int | None = None,
    agents: NDArray[np.int64] | None = None,
) -> Iterator[TrackRows]:
    """Yield rows of every ``every``-th step, counted from step 0, from ``first`` to before ``end``, in blocks of steps.

    Parameters
    ----------
    recording : RecordedFile
        The recording.
    every, first, end : int
        Steps to take: the multiples of ``every`` from ``first`` to before ``end``. By default, and at most, ``end`` is
        the number of recorded steps.
    agents : (n,) int64 or None
        Agents to take, ascending; by default all.

    Raises
    ------
    RecordingError
        If the position of a present agent is not finite.
    """
    last = recording.steps if end is None else min(end, recording.steps)
    for begin in range(first, last, _STEPS_AT_ONCE):
        steps = np.arange(begin, min(begin + _STEPS_AT_ONCE, last))
        wanted = np.flatnonzero(steps % every == 0)
        # If ``every`` is larger than a block, some blocks have no step to take.
        if not len(wanted):
            continue
        block = slice(begin, int(steps[-1]) + 1)
        state = _part(recording.state[block], wanted, agents)
        row, column = np.nonzero(state != AgentState.ABSENT)
        columns = (recording.x, recording.y, recording.heading, recording.behavior)
        x, y, heading, behavior = (_part(values[block], wanted, agents)[row, column] for values in columns)
        rows = TrackRows(
            agent=(column if agents is None else agents[column]).astype(np.int64),
            frame=steps[wanted][row] // every,
            x=x,
            y=y,
            heading=heading,
            behavior=behavior,
            state=state[row, column],
        )
        lost = np.flatnonzero(~(np.isfinite(x) & np.isfinite(y) & np.isfinite(heading)))
        if lost.size:
            raise RecordingError(
                f"{recording.path} is damaged: agent {rows.agent[lost[0]]} is present, but has no position; "
                "run the scenario again to the end"
            )
        yield rows


def _part(values: NDArray[Any], rows: NDArray[np.int64], columns: NDArray[np.int64] | None) -> NDArray[Any]:
    """Return rows (r,) of a block (steps, N), and of these some columns (c,), or all if ``columns`` is None."""
    chosen = values[rows]
    return chosen if columns is None else chosen[:, columns]


def all_rows(blocks: Iterator[TrackRows]) -> TrackRows:
    """Return the rows of all ``blocks`` together."""
    # Without blocks, the empty arrays in front give each column its type.
    types = (np.int64, np.int64, np.float32, np.float32, np.float32, np.int8, np.int8)
    parts = list(zip(*blocks, strict=True)) or [()] * len(types)
    return TrackRows(*(np.concatenate([np.zeros(0, kind), *part]) for kind, part in zip(types, parts, strict=True)))


def track_frame(recording: RecordedFile, rows: TrackRows, rate: float) -> pandas.DataFrame:
    """Return ``rows``, at ``rate`` frames per second, as a pandas frame; raise RecordingError if pandas is missing."""
    try:
        import pandas
    except ImportError:
        raise RecordingError(TABLES_NEED) from None
    header = recording.header
    names, groups = np.unique(np.array(header.agents.groups, np.str_), return_inverse=True)
    categories = pandas.Categorical.from_codes
    return pandas.DataFrame(
        {
            "id": rows.agent,
            "frame": rows.frame,
            "time": rows.frame / rate,
            "x": rows.x,
            "y": rows.y,
            "heading": rows.heading,
            "behavior": categories(rows.behavior, [behavior.name for behavior in header.behaviors]),
            "state": categories(rows.state, [state.name.lower() for state in AgentState]),
            "group": categories(groups[rows.agent], names),
        }
    )
