"""Plain tables on stdout: colored and wrapped on a terminal, one line per row elsewhere."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import typer

if TYPE_CHECKING:
    from rich.table import Table


def print_table(rows: Sequence[tuple[str, str]]) -> None:
    """Print rows (label, value)."""
    from rich.table import Table

    table = Table(show_header=False, box=None, pad_edge=False)
    table.add_column(style="cyan", no_wrap=True)
    table.add_column(overflow="fold")
    for label, value in rows:
        table.add_row(label, value)
    _print(table)


def print_rows(rows: Sequence[Mapping[str, Any]]) -> None:
    """Print mappings with the same keys under a header line, nothing without any; None leaves its cell empty."""
    from rich.table import Table

    if not rows:  # without a row, the keys of the header are unknown
        return
    table = Table(box=None, pad_edge=False, header_style="cyan")
    for key in rows[0]:
        number = any(isinstance(row[key], int | float) for row in rows)
        table.add_column(key, justify="right" if number else "left", overflow="fold")
    for row in rows:
        table.add_row(*("" if value is None else str(value) for value in row.values()))
    _print(table)


def _print(table: Table) -> None:
    """Print a table: wrapped to the width of a terminal; in full width to a file or a pipe."""
    from rich.console import Console

    console = Console(markup=False, highlight=False)
    if not console.is_terminal:
        console.width = 10_000
    with console.capture() as text:
        console.print(table)
    # Print it with typer: rich pads every line, and ends the process if the reader of a pipe is gone.
    typer.echo("\n".join(line.rstrip() for line in text.get().splitlines()))
