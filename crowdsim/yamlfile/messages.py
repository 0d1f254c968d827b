"""Turn pydantic's validation errors into problems that a user can act on."""

from __future__ import annotations

import difflib
import re
import types
import typing
from collections.abc import Iterable
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from crowdsim.errors import Problem
from crowdsim.yamlfile.document import Document, Path, shorten

# By pydantic's kind of error: the name of the bound in its context, and the words for a message.
_BOUNDS = {
    "greater_than_equal": ("ge", "at least"),
    "greater_than": ("gt", "greater than"),
    "less_than_equal": ("le", "at most"),
    "less_than": ("lt", "less than"),
}


def schema_problems(error: ValidationError, document: Document, model: type[BaseModel]) -> list[Problem]:
    """Return the problems of ``error``, with the positions of their entries in ``document``.

    ``model`` is the schema of the document. Errors that follow from a broken entry, or from another error, are left
    out.
    """
    problems = []
    for detail in error.errors(include_url=False):
        path: Path = detail["loc"]
        if any(path[:length] in document.broken for length in range(len(path) + 1)) or _follows_from_another(detail):
            continue
        # A missing item has no place in the text: the list that lacks it is at fault.
        if detail["type"] == "missing" and isinstance(path[-1], int):
            path = path[:-1]
        message = _message(detail, path, model)
        problems.append(document.problem(path, message, of_key=detail["type"] == "extra_forbidden"))
    return problems


def nearest(word: str, names: Iterable[str], otherwise: str) -> str:
    """Return ``did you mean 'x'?`` with the most similar of ``names``.

    If none is similar, return ``otherwise`` followed by all names.
    """
    names = list(names)
    close = difflib.get_close_matches(word[:80].lower(), names, n=1)
    return f"did you mean '{close[0]}'?" if close else f"{otherwise}: {', '.join(names) or 'none'}"


def _follows_from_another(detail: ErrorDetails) -> bool:
    """Return whether an error only repeats that a list has bad items, or names a second missing item of a list."""
    # Pydantic counts good items only: the list as given may be long enough.
    if detail["type"] == "too_short":
        return bool(len(detail["input"]) >= detail["ctx"]["min_length"])
    last = detail["loc"][-1] if detail["loc"] else None
    return detail["type"] == "missing" and isinstance(last, int) and last > len(detail["input"])


def _message(detail: ErrorDetails, path: Path, model: type[BaseModel]) -> str:
    """Return a message for users on an error of pydantic: what is wrong, and what the file may have there.

    ``path`` leads to the value, or to the key that is unknown or missing; for an item that a list lacks, to the list.
    """
    kind, value, context = detail["type"], detail["input"], detail.get("ctx", {})
    annotation = _annotation(model, path[:-1] if kind in ("extra_forbidden", "missing") and path else path)
    if kind == "extra_forbidden":
        return f"unknown key; {nearest(str(path[-1]), _keys(annotation), 'the keys here are')}"
    if kind == "missing" and isinstance(value, dict):
        return "this key is required and missing"
    # Here the value is a list: one item is missing, or it has too many or too few.
    if kind in ("too_long", "too_short") and isinstance(value, dict):
        bound, count = ("least", context["min_length"]) if kind == "too_short" else ("most", context["max_length"])
        return f"expected at {bound} {count} {'entry' if count == 1 else 'entries'}, got {len(value)}"
    if kind in ("missing", "too_long", "too_short"):
        return f"expected {_wanted_list(_annotation(model, path), context)}, got {len(value)}"
    if kind == "literal_error":
        return _literal_message(value, context["expected"])
    if kind in _BOUNDS:
        name, words = _BOUNDS[kind]
        return f"must be {words} {context[name]}, got {shorten(str(value))}"
    if kind == "value_error":
        return str(context["error"])
    if kind == "finite_number":
        return f"expected a finite number, got {value}"
    if kind in ("string_too_short", "string_pattern_mismatch"):
        return "must be one line of text that neither begins nor ends with a space"
    if kind == "string_too_long":
        return f"longer than {context['max_length']} characters"
    return _type_message(kind, value, annotation)


def _type_message(kind: str, value: Any, annotation: Any) -> str:
    """Return what was expected at a value of the wrong type, and what stands there.

    ``kind`` is pydantic's kind of error, ``annotation`` the type that the schema requires.
    """
    got = _describe(value)
    if kind in ("model_type", "model_attributes_type", "dict_type"):
        keys = ", ".join(_keys(annotation))  # none if any key may be there
        return f"expected a mapping{f' with keys among {keys}' if keys else ''}, got {got}"
    if kind == "tuple_type":
        return f"expected a list, got {got}"
    if kind == "string_type":
        return f"expected text, got {got}; put it in quotes if it is meant as text"
    if kind == "bool_type":
        return f"expected true or false, got {got}"
    if kind in ("float_type", "int_type", "int_from_float"):
        if kind == "float_type" and isinstance(value, int) and not isinstance(value, bool):
            return f"the number {shorten(str(value))} is too large"
        hint = ""
        if isinstance(value, str) and re.fullmatch(r"[-+]?\d+,\d+", value.strip()):
            hint = f"; write a decimal with a point: {value.strip().replace(',', '.')}"
        return f"expected a {'number' if kind == 'float_type' else 'whole number'}, got {got}{hint}"
    return f"not usable here, got {got}"


def _literal_message(value: Any, expected: str) -> str:
    """Return a message on a value that is none of those ``expected``, as pydantic lists them in quotes."""
    names = re.findall(r"'([^']*)'", expected)
    if isinstance(value, str) and names:
        return f"unknown value '{shorten(value)}'; {nearest(value, names, 'the values here are')}"
    return f"expected {expected}, got {_describe(value)}"


def _wanted_list(annotation: Any, context: dict[str, Any]) -> str:
    """Return in words how long a list must be: by the type of a tuple of fixed length, else by the bound exceeded.

    ``annotation`` is the type that the schema requires, ``context`` the context of pydantic's error, with the bound.
    """
    arguments = typing.get_args(_bare(annotation))
    if arguments and arguments[-1] is not Ellipsis:
        return f"a list of {len(arguments)} numbers"
    bound, number = ("most", context["max_length"]) if "max_length" in context else ("least", context["min_length"])
    return f"at {bound} {number} {'entry' if number == 1 else 'entries'}"


def _describe(value: Any) -> str:
    """Return a YAML value in words."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return f"the number {shorten(str(value))}"
    if isinstance(value, str):
        return f"the text '{shorten(value)}'"
    return "a list" if isinstance(value, list) else "a mapping"


def _bare(annotation: Any) -> Any:
    """Return ``annotation`` without its metadata and without ``| None``; of other unions, the first type."""
    while True:
        origin = typing.get_origin(annotation)
        if origin is typing.Annotated:
            annotation = typing.get_args(annotation)[0]
        elif origin in (typing.Union, types.UnionType):
            annotation = next(a for a in typing.get_args(annotation) if a is not type(None))
        else:
            return annotation


def _annotation(model: type[BaseModel], path: Path) -> Any:
    """Return the type that the schema ``model`` requires at ``path``, as :func:`_bare` gives it."""
    annotation: Any = model
    for part in path:
        annotation = _bare(annotation)
        if isinstance(annotation, type) and issubclass(annotation, BaseModel):
            fields = annotation.model_fields
            annotation = next(field.annotation for name, field in fields.items() if part in (name, field.alias))
        elif typing.get_origin(annotation) is dict:
            annotation = typing.get_args(annotation)[1]
        else:
            # A tuple of any length, or of a fixed one.
            arguments = typing.get_args(annotation)
            annotation = arguments[0] if arguments[-1] is Ellipsis else arguments[int(part)]
    return _bare(annotation)


def _keys(annotation: Any) -> list[str]:
    """Return the keys of a model as a file has them; none for other types."""
    fields = getattr(annotation, "model_fields", {})
    return [field.alias or name for name, field in fields.items()]
