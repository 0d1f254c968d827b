"""Load scenario files: a validated scenario, or every problem of the file at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from crowdsim.errors import CrowdSimError, Problem, ScenarioError
from crowdsim.library import library_folder
from crowdsim.scenario.composing.files import Files
from crowdsim.scenario.composing.validation import refuse, validated
from crowdsim.scenario.scenario import Scenario
from crowdsim.yamlfile.document import read_document, read_text
from crowdsim.yamlfile.messages import nearest
from crowdsim.yamlfile.overrides import apply_overrides


def load_scenario(
    source: str | Path, overrides: Sequence[str] = (), progress: Callable[[int, int], None] | None = None
) -> Scenario:
    """Read and check a scenario.

    Parameters
    ----------
    source : str or Path
        Path of a YAML file, or the name of a built-in scenario (``"corridor"``) if there is no such file.
    overrides : sequence of str
        Entries to replace, as ``"agents.0.count=4"``; the values are YAML.
    progress : callable or None
        Called as ``progress(done, all)`` with numbers of solids while meshes become layers, if they have many
        triangles; see :func:`~crowdsim.environment.layers.clearance_layers`.

    Returns
    -------
    Scenario
        The checked scenario.

    Raises
    ------
    ScenarioError
        With every problem of the file and the overrides.
    CrowdSimError
        If ``source`` is neither a path nor a name, or an override is no text.

    Examples
    --------
    >>> load_scenario("doorway", ["agents.0.count=2"]).agents[0].count
    2
    """
    if not isinstance(source, str | Path):
        raise CrowdSimError(f"expected the path or the name of a scenario, got {source!r}")
    path = _find(source)
    text, problems = read_text(path, str(source))
    if problems:
        raise ScenarioError(problems)
    return parse_scenario(text, path, overrides, progress)


def parse_scenario(
    text: str,
    path: Path | None = None,
    overrides: Sequence[str] = (),
    progress: Callable[[int, int], None] | None = None,
) -> Scenario:
    """Read and check a scenario from the text of its file, as :func:`load_scenario` does.

    Parameters
    ----------
    text : str
        YAML text.
    path : Path or None
        File name for messages; relative file names in the scenario start from its folder.
    overrides : sequence of str
        Entries to replace.
    progress : callable or None
        See :func:`load_scenario`.
    """
    if isinstance(overrides, str) or not isinstance(overrides, Sequence):
        raise CrowdSimError(f"expected a list of overrides like 'agents.0.count=4', got {overrides!r}")
    for override in overrides:
        if not isinstance(override, str):
            raise CrowdSimError(f"expected overrides as texts like 'agents.0.count=4', got {override!r}")
    document, problems = read_document(text, "<text>" if path is None else str(path))
    # Keys after a syntax error are unknown: report no keys as missing.
    if not document.complete:
        refuse(problems)
    if document.value is None and not overrides:
        refuse([*problems, document.problem((), "the file is empty")])
    problems += apply_overrides(document, overrides)
    files = Files((path or Path()).parent, {})
    keys, environment = validated(document, files, problems, progress)
    return Scenario.of(keys, document, text, path, files, environment)


def builtin_scenarios() -> dict[str, Path]:
    """Return the files of the built-in scenarios by name, sorted."""
    return {path.stem: path for path in sorted(library_folder("scenarios").glob("*.yaml"))}


def _find(source: str | Path) -> Path:
    """Return the scenario file at a path, or the built-in one of this name if nothing is there; else raise an error."""
    path = Path(source)
    try:
        if path.is_file():
            return path
    except OSError as error:
        raise ScenarioError([Problem(str(source), None, None, "", str(error.strerror))]) from None
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
