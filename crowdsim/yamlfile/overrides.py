"""Apply overrides ``path=value`` to the entries of a scenario, as given with ``--set``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from crowdsim.errors import Problem
from crowdsim.yamlfile.document import Document, Path, Position, read_document


def apply_overrides(document: Document, overrides: Sequence[str]) -> list[Problem]:
    """Write each override, such as ``agents.0.count=4``, into the document, in order; return what is wrong with them.

    The value is YAML, so that ``floor={rectangle: [0, 0, 4, 4]}`` works. Absent keys are added (the schema later
    decides whether they are allowed); absent list entries are not, but a problem. Problems that the schema finds with a
    value are reported at ``--set path`` instead of the file.
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
    """Set the entry of a document at the path ``parts`` to ``value``; return what is wrong, None if nothing is.

    Mappings that are missing on the way are made; list entries must be there. ``position`` becomes the position of the
    entry and of all in it.
    """
    # The file is empty.
    if document.value is None:
        document.value = {}
    container: Any = document.value
    path: Path = ()
    for number, part in enumerate(parts):
        last = number == len(parts) - 1
        key: str | int = part
        if isinstance(container, list):
            # Below 9 digits: more than any list needs, and few enough for int().
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
    """Forget the positions and faults of an entry that is replaced, and of all that is in it."""
    for places in (document.values, document.keys):
        for inner in [p for p in places if p[: len(path)] == path]:
            del places[inner]
    document.broken -= {p for p in document.broken if p[: len(path)] == path}
