"""Results as table rows, JSON, an HTML page, and a Markdown page for the docs."""

from __future__ import annotations

import base64
import html
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from crowdsim.validate.criteria import Finding
from crowdsim.validate.running import Outcome
from crowdsim.validate.suite import MISSING

COLUMNS = ("test", "figure", "least", "median", "most", "band", "passed", "source")


def rows_of(outcomes: Sequence[Outcome]) -> list[dict[str, str]]:
    """Return a row of texts by COLUMNS for each figure of each test.

    It holds the least, median and greatest value over the seeds, and how many values are in the band. All three are nan
    if a value is nan; the median is also nan if a value is infinite.
    """
    rows = []
    for outcome in outcomes:
        for findings in outcome.findings:
            first = findings[0]
            values = np.array([finding.value for finding in findings])
            known = bool(np.isfinite(values).all())  # a median would hide a seed in which an agent stayed
            middle = float(np.median(values)) if known else math.nan
            cells = (_number(float(values.min())), _number(middle), _number(float(values.max())))
            passed = sum(finding.passed for finding in findings)
            unit = f" [{first.unit}]" if first.unit else ""
            row = (
                outcome.test.name,
                first.what + unit,
                *cells,
                band_of(findings),
                f"{passed} of {len(findings)}",
                first.source,
            )
            rows.append(dict(zip(COLUMNS, row, strict=True)))
    return rows


def band_of(findings: Sequence[Finding]) -> str:
    """Return in words the band of a figure, given by its findings for all seeds.

    If bands depend on the seed, it reaches from the least of their lower ends to the greatest of their upper ends. An
    infinite upper end is not named, and a band of one value is that value.
    """
    least, most = min(finding.least for finding in findings), max(finding.most for finding in findings)
    if math.isinf(most):
        return f"at least {_number(least)}"
    if least == most:
        return _number(least)
    return f"{_number(least)} to {_number(most)}"


def as_json(outcomes: Sequence[Outcome], locomotion: str) -> dict[str, Any]:
    """Return all results for programs; values and ends of bands that are nan or infinite are None."""

    def figure(findings: Sequence[Finding]) -> dict[str, Any]:
        """Return one figure, given by its findings for all seeds, with their values and bands."""
        first = findings[0]
        return {
            "what": first.what,
            "unit": first.unit,
            "source": first.source,
            "values": [_plain(finding.value) for finding in findings],
            "least": [_plain(finding.least) for finding in findings],
            "most": [_plain(finding.most) for finding in findings],
            "passed": [finding.passed for finding in findings],
        }

    return {
        "locomotion": locomotion,
        "tests": [
            {
                "name": outcome.test.name,
                "title": outcome.test.title,
                "source": outcome.test.source,
                "passed": outcome.passed,
                "verdict": outcome.verdict,
                "seeds": list(outcome.seeds),
                "seconds": round(outcome.seconds, 1),
                "figures": [figure(findings) for findings in outcome.findings],
                "state_hashes": {case: list(hashes) for case, hashes in outcome.hashes.items()},
            }
            for outcome in outcomes
        ],
        "missing": [missing._asdict() for missing in MISSING],
    }


# The values of `Outcome.verdict`, in the words of the page.
_VERDICTS = {
    "passed": "passed",
    "departs": "departs from the guideline on purpose",
    "failed": "**failed**",
}


def as_markdown(outcomes: Sequence[Outcome], locomotion: str, page: Path) -> str:
    """Return the page of the docs, in Markdown.

    Parameters
    ----------
    outcomes : sequence of Outcome
        Results of the tests, at least one; all were run with the same seeds.
    locomotion : str
        Level of the agents, for the title.
    page : path
        File that the text is for, ``NAME.md``; nothing is written. The text shows ``images/NAME/TEST.png`` beside it, a
        picture of each test.

    Returns
    -------
    str
        The text.
    """
    seeds = outcomes[0].seeds
    counts = {verdict: sum(outcome.verdict == verdict for outcome in outcomes) for verdict in _VERDICTS}
    minutes = sum(outcome.seconds for outcome in outcomes) / 60.0
    departing = f"; outside of the guideline on purpose: {counts['departs']}" if counts["departs"] else ""
    text = [
        f"# Validation, {locomotion}",
        "",
        f"How `{locomotion}` agents ([levels.md](levels.md)) do in the tests by which evacuation models are "
        "judged. For readers who compare models, or have to show that one is fit for use.",
        "",
        f"{counts['passed']} of {len(outcomes)} tests pass{departing}; failed: {counts['failed']}. A test passes if "
        f"every figure is in its band with each seed ({_span(seeds)}).",
        "",
        f"Made by `crowdsim validate --seeds {len(seeds)} --locomotion {locomotion} --markdown docs/{page.name}`, do "
        f"not edit by hand: {minutes:.0f} minutes of computing.",
        "A figure that is unknown, as an agent stayed, is `nan` or `inf` and does not pass. Pictures show the ways",
        "of the first run of a test, each group in a color of its own, with the areas and lines that are measured;",
        "`--html OUT.html` writes one page with them in it.",
        "`--list` names the tests, `--jobs` is how many runs go on at once, `--json` gives everything with the hash of",
        "each run. The exit code is 4 if a test fails.",
        "",
    ]
    for outcome in outcomes:
        verdict = _VERDICTS[outcome.verdict]
        text += [f"## {outcome.test.name}: {outcome.test.title}", "", f"{outcome.test.source}: {verdict}.", ""]
        text += [outcome.test.meaning, ""]
        text += ["| figure | least | median | most | band | in it | from |", "|---|---|---|---|---|---|---|"]
        for row in rows_of([outcome]):
            text.append("| " + " | ".join(row[column] for column in COLUMNS[1:]) + " |")
        picture = f"images/{page.stem}/{outcome.test.name}.png"
        text += ["", f"![Ways of {outcome.test.cases[0].name}]({picture})", ""]
    text += ["## Not run", "", "| test | what it is about | why not |", "|---|---|---|"]
    text += [f"| {missing.source} | {missing.title} | {missing.reason} |" for missing in MISSING]
    return "\n".join(text) + "\n"


def as_html(outcomes: Sequence[Outcome], locomotion: str, pictures: Path) -> str:
    """Return one page of HTML with the pictures in it, ``pictures/TEST.png`` of each test.

    ``outcomes`` is not empty, and all have the same seeds; ``locomotion`` is the level of the agents, for the title.
    """
    parts = [f"<h1>Validation, {html.escape(locomotion)} agents, seeds {_span(outcomes[0].seeds)}</h1>"]
    for outcome in outcomes:
        verdict = outcome.verdict
        parts.append(
            f"<h2 class='{verdict}'>{html.escape(f'{outcome.test.name}: {outcome.test.title}, {verdict}')}</h2>"
        )
        parts.append(f"<p>{html.escape(f'{outcome.test.source}. {outcome.test.meaning}')}</p>")
        head = "".join(f"<th>{column}</th>" for column in COLUMNS[1:])
        body = "".join(
            "<tr>" + "".join(f"<td>{html.escape(row[column])}</td>" for column in COLUMNS[1:]) + "</tr>"
            for row in rows_of([outcome])
        )
        parts.append(f"<table><tr>{head}</tr>{body}</table>")
        picture = base64.b64encode((pictures / f"{outcome.test.name}.png").read_bytes()).decode("ascii")
        parts.append(
            f"<img alt='ways of {html.escape(outcome.test.cases[0].name)}' src='data:image/png;base64,{picture}'>"
        )
    missing = "".join(
        "<tr>" + "".join(f"<td>{html.escape(part)}</td>" for part in missing) + "</tr>" for missing in MISSING
    )
    parts.append(f"<h2>Not run</h2><table>{missing}</table>")
    style = (
        "body{font-family:sans-serif;max-width:70em;margin:2em auto}table{border-collapse:collapse}"
        "td,th{border:1px solid #ccc;padding:.2em .5em;text-align:left}"
        ".failed{color:#b00}.departs{color:#850}.passed{color:#060}"
    )
    return (
        "<!doctype html><html lang='en'><head><meta charset='utf-8'><title>crowdsim validate</title>"
        f"<style>{style}</style></head><body>{''.join(parts)}</body></html>\n"
    )


def _span(seeds: Sequence[int]) -> str:
    """Return the only seed, or the first and the last one of consecutive seeds."""
    return str(seeds[0]) if len(seeds) == 1 else f"{seeds[0]} to {seeds[-1]}"


def _number(value: float) -> str:
    """Return whole numbers without a point, others with three significant digits, and ``nan`` or ``inf``."""
    if not math.isfinite(value):
        return str(value)
    return f"{value:.0f}" if value == round(value) else f"{value:.3g}"


def _plain(value: float) -> float | None:
    """Return the value; None, which JSON can hold, if it is nan or infinite."""
    return value if math.isfinite(value) else None
