"""Validate plain keys and build their environment, or report everything that is wrong."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import NoReturn

from pydantic import ValidationError

from crowdsim.errors import Problem, ScenarioError
from crowdsim.scenario.composing.files import Files
from crowdsim.scenario.environment import Environment, build_environment
from crowdsim.scenario.people.commanded import Called, command_complaint
from crowdsim.scenario.people.crowd_placement import try_crowd_placement
from crowdsim.scenario.people.placement import NOMINAL_RADIUS, try_placement
from crowdsim.scenario.schema.schema import ScenarioFields
from crowdsim.scenario.semantics import key_complaints
from crowdsim.yamlfile.document import Complaint, Document
from crowdsim.yamlfile.messages import schema_problems


def validated(
    document: Document,
    files: Files,
    problems: Sequence[Problem] = (),
    progress: Callable[[int, int], None] | None = None,
) -> tuple[ScenarioFields, Environment]:
    """Check the keys of ``document``, build their environment, and check that every agent finds a place.

    Parameters
    ----------
    document : Document
        Plain values of the scenario with their positions.
    files : Files
        Files that the keys name.
    problems : sequence of Problem
        Problems found so far; they are reported with the others.
    progress : callable or None
        Passed on to :func:`~crowdsim.environment.layers.clearance_layers`.

    Returns
    -------
    keys : ScenarioFields
        The validated keys.
    environment : Environment
        Their environment.

    Raises
    ------
    ScenarioError
        With ``problems`` and every key whose value the schema refuses; if there are none of these, with everything else
        that is wrong. If the environment cannot be built, neither places of agents nor commands about agents are
        checked.
    """
    try:
        keys = ScenarioFields.model_validate(document.value)
    except ValidationError as error:
        refuse([*problems, *schema_problems(error, document, ScenarioFields)])
    if problems:
        refuse(problems)
    environment, complaints = build_environment(keys, files, progress)
    complaints = [*key_complaints(keys, files.folder), *complaints]
    if environment is not None:
        if keys.steers:
            complaints += try_crowd_placement(keys, environment)[1]
        else:
            complaints += try_placement(keys, environment, NOMINAL_RADIUS)[1]
        complaints += _command_complaints(keys, environment)
    if complaints or environment is None:
        refuse(document.problem(*complaint) for complaint in complaints)
    return keys, environment


def _command_complaints(keys: ScenarioFields, environment: Environment) -> list[Complaint]:
    """Return what is wrong with the commands about agents, in the order of their times."""
    complaints: list[Complaint] = []
    called = Called(keys)
    for number, command in sorted(enumerate(keys.commands), key=lambda each: each[1].at):
        wrong = command_complaint(keys, environment, command, called)
        if wrong is not None:
            complaints.append((("commands", number, *wrong[0]), wrong[1]))
        called.take(command)
    return complaints


def refuse(problems: Iterable[Problem]) -> NoReturn:
    """Raise ScenarioError with ``problems`` in the order of the file, each once; those without a line go first."""
    # Several groups may find the same problem, in an exit or a route that they share.
    once = dict.fromkeys(problems)
    raise ScenarioError(sorted(once, key=lambda p: (p.line is not None, p.line or 0, p.column or 0)))
