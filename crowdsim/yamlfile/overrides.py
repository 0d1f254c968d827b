"""Overrides ``path=value`` of a scenario's entries, as ``--set`` gives them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from crowdsim.errors import Problem
from crowdsim.yamlfile.document import Document, Path, Position, read_document


def apply_overrides(document: Document, overrides: Sequence[str]) -> list[Problem]:
    """Write each ``agents.0.count=4`` into the document, in order; return what is wrong with them.

    The value is YAML, so that ``floor={rectangle: [0, 0, 4, 4]}`` works. Keys that are absent are made (the schema
    tells whether they may be), list entries are not. What the schema has against the value is later reported at
    ``--set path`` in place of the file.
    """
    problems = []
    for override in overrides:
        path_text, equals, value_text = override.partition("=")
        label = f"--set {path_text}"
        parts = path_text.strip().split(".")
        if not equals or not all(parts):
            message = "expected path=value, such as agents.0.count=4"
            problems.append(Problem(f"--set {override}", None, None, "", message))
            continue
        value, wrong = read_document(value_text, label)
        if wrong:
            problems += [Problem(label, None, None, "", problem.message) for problem in wrong]
            continue
        complaint = _write(document, parts, value, Position(label))
        if complaint:
            problems.append(Problem(label, None, None, "", complaint))
    return problems


def _write(document: Document, parts: list[str], value: Document, position: Position) -> str | None:
    if document.value is None:
        document.value = {}
    container: Any = document.value
    path: Path = ()
    for number, part in enumerate(parts):
        last = number == len(parts) - 1
        key: str | int = part
        if isinstance(container, list):
            if not (part.isascii() and part.isdigit() and len(part) < 9 and int(part) < len(container)):
                entries = f"0 to {len(container) - 1}" if container else "none"
                return f"'{part}' is no entry of the list {'.'.join(parts[:number])}; it has {entries}"
            key = int(part)
        elif not isinstance(container, dict):
            return f"{'.'.join(parts[:number]) or 'the scenario'} has no entries to set"
        path = (*path, key)
        if last:
            _forget(document, path)
            container[key] = value.value
            document.values.update({path + inner: position for inner in ((), *value.values)})
            document.keys.update({path + inner: position for inner in ((), *value.keys)})
            return None
        if isinstance(container, dict) and key not in container:
            container[key] = {}
            document.values[path] = document.keys[path] = position
        container = container[key]
    return None


def _forget(document: Document, path: Path) -> None:
    for places in (document.values, document.keys):
        for inner in [p for p in places if p[: len(path)] == path]:
            del places[inner]
    document.broken -= {p for p in document.broken if p[: len(path)] == path}
