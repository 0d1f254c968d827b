"""Write ``tests/golden/golden.json`` again, after a change that is meant to change results.

``python tools/update_golden.py`` prints what has changed. The tests compare every scenario of the library and a hundred
plans with the file.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from crowdsim.scenario.loader import builtin_scenarios
from tests.support import golden


def main() -> None:
    """Compute all figures, print the differences, and write the file."""
    before = json.loads(golden.FILE.read_text(encoding="utf-8")) if golden.FILE.is_file() else {}
    found = {
        "scenarios": {name: golden.library_figures(name) for name in sorted(builtin_scenarios())},
        "plans": {place: golden.plan_costs(place) for place in golden.PLACES},
    }
    for kind, figures in found.items():
        for name, value in figures.items():
            old = before.get(kind, {}).get(name)
            if old != value:
                print(f"{name}: {old} -> {value}" if kind == "scenarios" else f"plans in {name} changed")
    golden.FILE.parent.mkdir(exist_ok=True)
    golden.FILE.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
