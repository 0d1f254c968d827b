"""Read YAML text into plain values whose positions in the text are known.

The values are built from the parser's events, not by its constructor. Every entry thus keeps its line and column,
scalars are resolved by the core schema of YAML 1.2 only, and no file can make the reader recurse without bound, expand
an alias or construct an object.
"""

from __future__ import annotations

import pathlib
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.events import (
    AliasEvent,
    DocumentStartEvent,
    Event,
    MappingEndEvent,
    MappingStartEvent,
    NodeEvent,
    ScalarEvent,
    SequenceEndEvent,
    SequenceStartEvent,
)

from crowdsim.errors import Problem

MAX_BYTES = 1_000_000
"""Largest accepted file [bytes]."""
MAX_DEPTH = 32
"""Largest depth of nested lists and mappings."""

Path = tuple[str | int, ...]
"""Keys and list indices from the root to an entry, as ``("agents", 0, "count")``."""

Complaint = tuple[Path, str]
"""The path of an entry, and what is wrong with it."""

# The core schema of YAML 1.2.2, section 10.3.2. It reads "no" as text, "0123" as 123, and "1:30" as text.
_NULL = re.compile(r"~|null|Null|NULL|")
_TRUE = re.compile(r"true|True|TRUE")
_FALSE = re.compile(r"false|False|FALSE")
_INT = re.compile(r"[-+]?[0-9]+")
_OCTAL = re.compile(r"0o[0-7]+")
_HEX = re.compile(r"0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_SPECIAL = re.compile(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")
_MAX_DIGITS = 400
"""Largest length of an integer [characters]: far more than any key accepts."""


@dataclass(frozen=True)
class Position:
    """A position in a text, line and column from 1; both are None if ``file`` is not a text file."""

    file: str
    line: int | None = None
    column: int | None = None


@dataclass
class Document:
    """The value of a YAML text, with the positions of its entries.

    Attributes
    ----------
    file : str
        Name of the file in messages.
    value : Any
        Plain value: dictionaries, lists, text, numbers, booleans, None.
    values, keys : dict of Path to Position
        Position of each value, and of each key of a mapping.
    broken : set of Path
        Entries that could not be read; later problems with them are consequences and are not reported.
    complete : bool
        Whether the text was read to its end.
    """

    file: str
    value: Any = None
    values: dict[Path, Position] = field(default_factory=dict)
    keys: dict[Path, Position] = field(default_factory=dict)
    broken: set[Path] = field(default_factory=set)
    complete: bool = False

    def position(self, path: Path, of_key: bool = False) -> Position:
        """Return the position of the value at ``path``, or of the closest enclosing entry that exists.

        With ``of_key``, return the position of its key, if that is known.
        """
        if of_key and path in self.keys:
            return self.keys[path]
        while path and path not in self.values:
            path = path[:-1]
        return self.values.get(path, Position(self.file, 1, 1))

    def problem(self, path: Path, message: str, of_key: bool = False) -> Problem:
        """Return a problem with the entry at ``path``, with the position of its value, or of its key if ``of_key``."""
        position = self.position(path, of_key)
        return Problem(position.file, position.line, position.column, dotted(path), message)


def dotted(path: Path) -> str:
    """Return a path as the user types it: ``agents.0.count``."""
    return ".".join(shorten(str(part)) for part in path)


def shorten(text: str, limit: int = 60) -> str:
    """Return the text on one printable line of at most ``limit`` characters, cut off with ``...`` if necessary."""
    line = " ".join(text.encode("utf-8", "replace").decode("utf-8").split())
    line = "".join(letter if letter.isprintable() else "?" for letter in line)
    return line if len(line) <= limit else line[: limit - 3] + "..."


def read_text(path: pathlib.Path, name: str) -> tuple[str, list[Problem]]:
    """Return the text of a file; if it cannot be read, an empty text and the problem.

    At most MAX_BYTES + 1 bytes are read, enough for :func:`read_document` to refuse the file. ``name`` stands for the
    file in the problem; if the text is not UTF-8, its path does, with line and column.
    """
    if path.exists() and not path.is_file():
        what = "it is a folder" if path.is_dir() else "it is no regular file"
        return "", [Problem(name, None, None, "", f"cannot be read: {what}")]
    try:
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except OSError as error:
        return "", [Problem(name, None, None, "", f"cannot be read: {error.strerror}")]
    try:
        return data.decode("utf-8"), []
    except UnicodeDecodeError as error:
        # A file that is too long may be cut within a character; let read_document refuse it for its length.
        if len(data) > MAX_BYTES:
            return data.decode("utf-8", "replace"), []
        lines = data[: error.start].decode("utf-8").split("\n")
        line, column = len(lines), len(lines[-1]) + 1
        return "", [Problem(str(path), line, column, "", "this is not UTF-8 text")]


def read_document(text: str, file: str) -> tuple[Document, list[Problem]]:
    """Read one YAML document; return everything that could be read, and what is wrong.

    ``file`` is its name in messages. After a syntax error nothing more is read, and the document is not ``complete``.
    """
    if len(text.encode("utf-8", "surrogatepass")) > MAX_BYTES:
        message = f"the file is larger than {MAX_BYTES // 1_000_000} MB; is it the right file?"
        return Document(file), [Problem(file, 1, 1, "", message)]
    reader = _Reader(_events(text), file)
    try:
        reader.read()
    except _Stop as stop:
        reader.problems.append(Problem(file, stop.line, stop.column, "", stop.message))
    return reader.document, reader.problems


class _Stop(Exception):
    """Raised if the parser cannot go on; line and column count from 1."""

    def __init__(self, line: int, column: int, message: str) -> None:
        super().__init__(message)
        self.line, self.column, self.message = line, column, message


def _events(text: str) -> Iterator[Event]:
    """Yield the parser's events; turn its errors into _Stop, at their position or at that of the last event."""
    line, column = 1, 1
    events = YAML(typ="safe", pure=True).parse(text)
    while True:
        try:
            event = next(events)
        except StopIteration:
            return
        except MarkedYAMLError as error:
            mark = error.problem_mark or error.context_mark
            if mark is not None:
                line, column = mark.line + 1, mark.column + 1
            raise _Stop(line, column, _syntax_message(error)) from None
        except YAMLError as error:
            # A character that YAML does not allow: the error has an offset in the text, not a line.
            offset = getattr(error, "position", None)
            if isinstance(offset, int):
                line, column = text.count("\n", 0, offset) + 1, offset - text.rfind("\n", 0, offset)
            raise _Stop(line, column, f"not YAML: {shorten(str(error), 120)}") from None
        except Exception as error:
            # On some malformed escapes the parser raises ValueError or the like; the file is at fault all the same.
            raise _Stop(line, column, f"not YAML: {shorten(str(error), 120) or type(error).__name__}") from None
        if event.start_mark is not None:
            line, column = event.start_mark.line + 1, event.start_mark.column + 1
        yield event


def _syntax_message(error: MarkedYAMLError) -> str:
    """Return in words what the parser found wrong."""
    problem = shorten(str(error.problem or error.context or "malformed"), 120)
    if "\\t" in problem:  # the parser names a tab by these two letters
        return "a tab cannot indent YAML; use spaces"
    context = f" ({shorten(str(error.context), 80)})" if error.context and error.problem else ""
    return f"not YAML: {problem}{context}"


class _Reader:
    """Builds values from events by recursive descent, no deeper than :data:`MAX_DEPTH`.

    ``path`` in methods is the path of the value that is read.
    """

    def __init__(self, events: Iterator[Event], file: str) -> None:
        self.events = events
        self.document = Document(file)
        self.problems: list[Problem] = []

    def read(self) -> None:
        """Read all events; refuse a second document. If the text holds no document, the value stays None."""
        documents = 0
        for event in self.events:
            if isinstance(event, DocumentStartEvent):
                documents += 1
                if documents > 1:
                    raise _Stop(*_spot(event), "a second document begins here; a file holds one")
                if event.version is not None and tuple(event.version) != (1, 2):
                    raise _Stop(*_spot(event), "files are YAML 1.2; remove the %YAML directive")
                self.document.value = self._value(next(self.events), ())
        self.document.complete = True

    def _value(self, event: Event, path: Path) -> Any:
        """Return the value that begins with ``event``, and record its position, and the problem if there is one.

        Raise _Stop if it is nested deeper than MAX_DEPTH.
        """
        self.document.values[path] = Position(self.document.file, *_spot(event))
        value: Any = None
        complaint = _complaint(event)
        if isinstance(event, ScalarEvent):
            try:
                value = _scalar(event)
            except ValueError as error:
                complaint = complaint or str(error)
        elif isinstance(event, SequenceStartEvent | MappingStartEvent):
            if len(path) >= MAX_DEPTH:
                raise _Stop(*_spot(event), f"nested more than {MAX_DEPTH} levels deep")
            value = self._list(path) if isinstance(event, SequenceStartEvent) else self._mapping(path)
        if complaint:
            self.document.broken.add(path)
            self.problems.append(self.document.problem(path, complaint))
        return value

    def _list(self, path: Path) -> list[Any]:
        """Read a list up to its end; its start has been read."""
        values: list[Any] = []
        while not isinstance(event := next(self.events), SequenceEndEvent):
            values.append(self._value(event, (*path, len(values))))
        return values

    def _mapping(self, path: Path) -> dict[str, Any]:
        """Read a mapping up to its end; its start has been read. Record the positions of its keys.

        Keys that are given twice, are no words or are not allowed are problems; of the same keys, the first value
        counts.
        """
        values: dict[str, Any] = {}
        while not isinstance(event := next(self.events), MappingEndEvent):
            position = Position(self.document.file, *_spot(event))
            key = event.value if isinstance(event, ScalarEvent) else None
            complaint = _complaint(event)
            if key is None:
                self._discard(event)
                complaint = complaint or "a key must be a plain word"
            elif key in values:
                complaint = f"key given twice; it is at line {self.document.keys[(*path, key)].line} already"
            if complaint:
                where = dotted(path if key is None else (*path, key))
                self.problems.append(Problem(position.file, position.line, position.column, where, complaint))
            if key is None or key in values:
                self._discard(next(self.events))
            else:
                self.document.keys[(*path, key)] = position
                inner = next(self.events)
                values[key] = self._value(inner, (*path, key))
                if isinstance(inner, ScalarEvent) and inner.start_mark.index == inner.end_mark.index:
                    self.document.values[(*path, key)] = position  # empty value: the parser marks the next line instead
        return values

    def _discard(self, event: Event) -> None:
        """Skip the value that begins with ``event``."""
        depth = 0
        while True:
            depth += isinstance(event, SequenceStartEvent | MappingStartEvent)
            depth -= isinstance(event, SequenceEndEvent | MappingEndEvent)
            if depth == 0:
                return
            event = next(self.events)


def _spot(event: Event) -> tuple[int, int]:
    """Return line and column at which an event begins, both from 1."""
    return event.start_mark.line + 1, event.start_mark.column + 1


def _complaint(event: Event) -> str | None:
    """Return why a node is not allowed: it is an alias, or has an anchor, a tag or half of a surrogate pair."""
    if isinstance(event, AliasEvent):
        return f"aliases are not allowed ('*{shorten(event.anchor)}'); write the value out"
    if not isinstance(event, NodeEvent):
        return None
    if event.anchor is not None:
        return f"anchors are not allowed ('&{shorten(event.anchor)}')"
    tag = getattr(event, "ctag", None)
    if tag is not None:
        return f"tags are not allowed ('{shorten(str(tag))}')"
    if isinstance(event, ScalarEvent) and any("\ud800" <= letter <= "\udfff" for letter in event.value):
        return "half of a surrogate pair is not a character; write the character itself"
    return None


def _scalar(event: ScalarEvent) -> Any:
    """Return the value of a scalar by the core schema; quoted and block scalars are text.

    Raise ValueError for an integer of more than _MAX_DIGITS characters.
    """
    text: str = event.value
    if not event.implicit[0]:
        return text
    if _NULL.fullmatch(text):
        return None
    if _TRUE.fullmatch(text) or _FALSE.fullmatch(text):
        return bool(_TRUE.fullmatch(text))
    for pattern, base in ((_INT, 10), (_OCTAL, 8), (_HEX, 16)):
        if pattern.fullmatch(text):
            if len(text) > _MAX_DIGITS:
                raise ValueError(f"a number of {len(text)} digits is too large")
            return int(text, base)
    if _SPECIAL.fullmatch(text):
        return float(text.replace(".", ""))  # Python reads inf and nan without the point
    return float(text) if _FLOAT.fullmatch(text) else text
