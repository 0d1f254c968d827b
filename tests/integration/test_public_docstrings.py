"""What ``crowdsim`` exports has the sections of numpy docstrings: all parameters, what is returned, what is raised."""

import ast
import dataclasses
import inspect
import re
import textwrap
from collections.abc import Iterator
from typing import Any

import pytest

import crowdsim

SECTION = re.compile(r"^(Parameters|Attributes|Returns|Yields|Raises|Examples|Notes)\n-+\n", re.MULTILINE)

OF_LIBRARIES = ("Scenario.model_post_init",)
"""Methods that pydantic makes."""


def sections(text: str | None) -> dict[str, str]:
    """Return the sections of a docstring by their headings."""
    parts = SECTION.split(inspect.cleandoc(text or ""))
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def named(section: str) -> set[str]:
    """Return the names that begin the entries of a section: of ``one, other : int``, both."""
    heads = [line.split(" : ")[0].split(":")[0] for line in section.splitlines() if line and not line[0].isspace()]
    return {name.strip().strip("*") for head in heads for name in head.split(",")}


def members(cls: type) -> Iterator[tuple[str, Any]]:
    """Yield the public functions of a class, those that it inherits from this package, too; no properties."""
    seen = set()
    for each in cls.__mro__:
        if not each.__module__.startswith("crowdsim"):
            continue
        for name, value in vars(each).items():
            function = value.__func__ if isinstance(value, classmethod | staticmethod) else value
            if not name.startswith("_") and name not in seen and inspect.isfunction(function):
                yield f"{cls.__name__}.{name}", function
            seen.add(name)


PUBLIC = {name: getattr(crowdsim, name) for name in crowdsim.__all__}
CLASSES = {name: value for name, value in PUBLIC.items() if inspect.isclass(value)}
FUNCTIONS = {name: value for name, value in PUBLIC.items() if inspect.isfunction(value)} | {
    name: function for cls in CLASSES.values() for name, function in members(cls) if name not in OF_LIBRARIES
}


def raised_by(function: Any) -> set[str]:
    """Return the names of the package's errors that a function itself raises."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    calls = [node.exc for node in ast.walk(tree) if isinstance(node, ast.Raise)]
    names = {call.func.id for call in calls if isinstance(call, ast.Call) and isinstance(call.func, ast.Name)}
    return {name for name in names if name.endswith(("Error", "NotFound", "Failed", "Handle"))}


def missing_of(function: Any) -> list[str]:
    """Return what the docstring of a function lacks."""
    said = sections(function.__doc__)
    signature = inspect.signature(function)
    arguments = [name for name in signature.parameters if name not in ("self", "cls")]
    missing = [name for name in arguments if name not in named(said.get("Parameters", ""))]
    if signature.return_annotation not in (None, "None") and not {"Returns", "Yields"} & said.keys():
        missing.append("Returns")
    return missing + [f"Raises {name}" for name in sorted(raised_by(function)) if name not in said.get("Raises", "")]


@pytest.mark.parametrize("name", sorted(FUNCTIONS))
def test_functions_have_all_sections(name: str) -> None:
    assert not missing_of(FUNCTIONS[name])


@pytest.mark.parametrize("name", sorted(CLASSES))
def test_classes_name_their_fields_or_parameters(name: str) -> None:
    cls = CLASSES[name]
    said = sections(cls.__doc__)
    known = named(said.get("Parameters", "")) | named(said.get("Attributes", ""))
    if issubclass(cls, Exception):
        needed = set()
    elif dataclasses.is_dataclass(cls):
        needed = {field.name for field in dataclasses.fields(cls) if field.init and not field.name.startswith("_")}
    elif issubclass(cls, tuple):
        needed = set(cls._fields)
    elif name == "Scenario":
        needed = {"keys"}  # which docs/scenarios.md describes
    else:
        needed = set(inspect.signature(cls.__init__).parameters) - {"self", "args", "kwargs"}
    assert not needed - known


def test_a_lack_is_found() -> None:
    def move(place: float, by: float) -> float:
        """Move.

        Parameters
        ----------
        place : float
            Where.
        """
        if by < 0.0:
            raise crowdsim_error("no")
        raise ValueError(place)

    assert missing_of(move) == ["by", "Returns", "Raises ValueError"]


crowdsim_error = crowdsim.CrowdSimError
