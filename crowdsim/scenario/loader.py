"""Scenario files to validated scenarios, with every problem of a file at once."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NoReturn

from pydantic import ValidationError

from crowdsim.errors import Problem, ScenarioError
from crowdsim.library import library_folder
from crowdsim.scenario.crowd_placement import try_crowd_placement
from crowdsim.scenario.environment import build_environment
from crowdsim.scenario.placement import NOMINAL_RADIUS, try_placement
from crowdsim.scenario.scenario import Scenario
from crowdsim.scenario.schema.schema import ScenarioFields
from crowdsim.scenario.semantics import key_complaints
from crowdsim.yamlfile.document import read_document, read_text
from crowdsim.yamlfile.messages import nearest, schema_problems
from crowdsim.yamlfile.overrides import apply_overrides


def load_scenario(source: str | Path, overrides: Sequence[str] = ()) -> Scenario:
    """Read and check a scenario.

    Parameters
    ----------
    source
        Path of a YAML file, or the name of a built-in scenario (``"corridor"``) where no such file is.
    overrides
        Entries to replace, ``"agents.0.count=4"``; values are YAML.

    Raises
    ------
    ScenarioError
        With every problem of the file and the overrides.
    """
    path = _find(source)
    text, problems = read_text(path, str(source))
    if problems:
        raise ScenarioError(problems)
    return parse_scenario(text, path, overrides)


def parse_scenario(text: str, path: Path | None = None, overrides: Sequence[str] = ()) -> Scenario:
    """:func:`load_scenario` of a text; ``path`` names it in messages and anchors the folders it refers to."""
    document, problems = read_document(text, "<text>" if path is None else str(path))
    if not document.complete:
        _refuse(problems)
    if document.value is None and not overrides:
        _refuse([*problems, document.problem((), "the file is empty")])
    problems += apply_overrides(document, overrides)
    try:
        keys = ScenarioFields.model_validate(document.value)
    except ValidationError as error:
        _refuse([*problems, *schema_problems(error, document, ScenarioFields)])
    if problems:
        _refuse(problems)
    folder = (path or Path()).parent
    environment, complaints = build_environment(keys, folder)
    complaints = [*key_complaints(keys, folder), *complaints]
    if environment is not None:
        if keys.steers:
            complaints += try_crowd_placement(keys, environment)[1]
        else:
            complaints += try_placement(keys, environment, NOMINAL_RADIUS)[1]
    if complaints or environment is None:
        _refuse(document.problem(*complaint) for complaint in complaints)
    return Scenario.of(keys, document, text, path, environment)


def builtin_scenarios() -> dict[str, Path]:
    """Files of the scenario library by name, sorted."""
    return {path.stem: path for path in sorted(library_folder("scenarios").glob("*.yaml"))}


def _find(source: str | Path) -> Path:
    path = Path(source)
    if path.is_file():
        return path
    name = str(source).removesuffix(".yaml")
    built_in = builtin_scenarios()
    if name in built_in and not path.exists():
        return built_in[name]
    if path.is_dir():
        message = "this is a folder; give a scenario file in it"
    else:
        hint = nearest(path.stem, built_in, "the built-in scenarios are")
        message = f"there is no such file, nor a built-in scenario of the name; {hint}"
    raise ScenarioError([Problem(str(source), None, None, "", message)])


def _refuse(problems: Iterable[Problem]) -> NoReturn:
    raise ScenarioError(sorted(problems, key=lambda p: (p.line is not None, p.line or 0, p.column or 0)))
