"""What docs/extending.md shows runs as it stands there."""

import re
import shutil
from pathlib import Path

import pytest

import crowdsim
from crowdsim.behaviors.behavior import BehaviorFile
from crowdsim.library import library_folder
from tests.support.doc_blocks import printed_by

TEXT = (Path(__file__).parents[2] / "docs" / "extending.md").read_text(encoding="utf-8")
PARK = re.search(r"^```yaml\n(.*?)^```", TEXT, re.M | re.S)[1]
BEHAVIOR = re.search(r"echo '(.*)' > stroll/behavior.yaml", TEXT)[1]


@pytest.fixture
def park(tmp_path: Path) -> Path:
    """The files of the page, with three walks of the library as the captures."""
    (tmp_path / "stroll").mkdir()
    for clip in ("walk_slow", "walk_long_start", "walk_left_10"):
        shutil.copy(library_folder("behaviors") / "frontal" / "clips" / f"{clip}.bvh", tmp_path / "stroll")
    (tmp_path / "stroll" / "behavior.yaml").write_text(BEHAVIOR + "\n", encoding="utf-8")
    (tmp_path / "park.yaml").write_text(PARK, encoding="utf-8")
    return tmp_path / "park.yaml"


def test_an_own_behavior_takes_ten_lines_at_most() -> None:
    assert len(PARK.splitlines()) + len(BEHAVIOR.splitlines()) <= 10


def test_the_own_behavior_is_checked_by_the_command(park: Path, crowdsim_here) -> None:
    finished = crowdsim_here("check", "park.yaml")
    assert finished.returncode == 0, finished.stderr
    assert finished.stdout.splitlines()[-1] == "park: ok"
    assert re.search(
        r"'stroll' reaches 0\.\d+ m at the legs, 0\.\d+ m at the torso .* goes at \d\.\d+ m/s", finished.stdout
    )


@pytest.mark.parametrize("locomotion", ["captured", "steered", "auto"])
def test_the_own_behavior_walks(park: Path, locomotion: str) -> None:
    # Cheaper than the other one, so that it is seen.
    (park.parent / "stroll" / "behavior.yaml").write_text("cost_per_meter: 0.9\n", encoding="utf-8")
    scenario = crowdsim.load_scenario(park, [f"agents.0.locomotion={locomotion}"])
    with crowdsim.Simulation(scenario).run(park.with_suffix(".h5")) as recording:
        assert recording.summary["arrived"] == 3
        assert recording.summary["behavior_share"]["stroll"] > 0.8
        assert [each.name for each in recording.header.behaviors] == ["frontal", "stroll"]
        assert min(recording.summary["obstacle_margin"].values()) >= -0.01


def test_every_key_of_a_behavior_is_described() -> None:
    table = TEXT[: TEXT.index("## A system")]
    told = {key for row in re.findall(r"^\| (`[^|]*) \|", table, re.M) for key in re.findall(r"`(\w+)`", row)}
    assert told == set(BehaviorFile.model_fields) - {"name"}


def test_blocks_run_in_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert printed_by("extending.md") == [
        "early ones infected: True",
        "late ones infected: False",
        "looked for [s]: [5.1 5.1 5.1]",
        "arrived: 3",
        "the same without the system: True",
    ]
