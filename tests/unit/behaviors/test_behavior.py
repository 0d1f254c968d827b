import numpy as np
import pytest

from crowdsim.behaviors.behavior import list_behaviors, read_behavior
from crowdsim.errors import BehaviorError

GOOD = """\
name: lateral
description: Side-stepping, the narrowest way through.
facing: [-90, 90]
detectors: [standing]
cost_per_meter: 3
speed: 0.58
color: "#d62728"
clips:
  - file: clips/side_left.bvh
transitions:
  - {file: clips/walk_to_side.bvh, from: frontal, to: lateral}
idle:
  - {file: clips/stand.bvh}
"""


@pytest.fixture
def library(tmp_path):
    def write(text, name="lateral"):
        folder = tmp_path / name
        (folder / "clips").mkdir(parents=True)
        for clip in ("side_left", "walk_to_side", "stand"):
            (folder / "clips" / f"{clip}.bvh").touch()
        (folder / "behavior.yaml").write_text(text, encoding="utf-8")
        return tmp_path

    return write


def test_good_file(library):
    entry = read_behavior("lateral", library(GOOD))
    behavior = entry.behavior(np.array([0.17, 0.2]), library)
    assert behavior.facings == pytest.approx((-np.pi / 2, np.pi / 2))
    assert behavior.turned
    assert entry.transitions[0].from_ == "frontal"
    assert entry.cost_per_meter == 3.0


def test_frontal_is_not_turned(library):
    entry = read_behavior("lateral", library(GOOD.replace("[-90, 90]", "[0]")))
    assert not entry.behavior(np.zeros(2), library).turned


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "cost_per_meter: 3",
            "cost_per_metre: 3",
            r"behavior.yaml:5:1: cost_per_metre: .*did you mean 'cost_per_meter'\?",
        ),
        ("from: frontal", "fron: frontal", r"behavior.yaml:11:36: transitions.0.fron: .*did you mean 'from'\?"),
        ("speed: 0.58", "speed: fast", r"behavior.yaml:6:8: speed: "),
        ("speed: 0.58", "speed: 0", r"behavior.yaml:6:8: speed: .*greater than 0"),
        ("speed: 0.58", "speed: .nan", r"behavior.yaml:6:8: speed: "),
        ("facing: [-90, 90]", "facing: []", r"behavior.yaml:3:9: facing: "),
        ("facing: [-90, 90]", "facing: [-90, 900]", r"behavior.yaml:3:15: facing.1: "),
        ('"#d62728"', "red", r"behavior.yaml:7:8: color: "),
        ("[standing]", "[standin]", r"behavior.yaml:4:13: detectors.0: .*'standin'; did you mean 'standing'\?"),
        ("side_left.bvh", "side_lft.bvh", r"behavior.yaml:9:11: clips.0.file: 'clips/side_lft.bvh' is missing"),
        ("name: lateral", "name: sideways", r"behavior.yaml:1:7: name: 'sideways' is not the name of its folder"),
        ("from: frontal, to: lateral", "from: frontal, to: crawl", r"neither begins nor ends with 'lateral'"),
        ("speed: 0.58", "speed: 0.58\nspeed: 0.6", r"behavior.yaml:7:1: speed: key given twice"),
        ("speed: 0.58", "speed: [", r"not YAML"),
        (GOOD, "[1, 2]", r"expected a mapping with keys among name, .*got a list"),
        (GOOD, "", r"expected a mapping .*got nothing"),
    ],
)
def test_wrong_files_are_explained(library, old, new, message):
    with pytest.raises(BehaviorError, match=r"(?s)" + message):
        read_behavior("lateral", library(GOOD.replace(old, new)))


def test_all_problems_of_a_file_at_once(library):
    text = GOOD.replace("speed: 0.58", "speed: fast").replace("color:", "colour:").replace("cost_per_meter: 3\n", "")
    with pytest.raises(BehaviorError) as caught:
        read_behavior("lateral", library(text))
    assert len(str(caught.value).splitlines()) == 3  # speed, colour unknown, cost_per_meter missing


def test_unknown_behavior(library):
    folder = library(GOOD)
    assert list_behaviors(folder) == ("lateral",)
    with pytest.raises(BehaviorError, match=r"no behavior 'laterl'.*did you mean 'lateral'"):
        read_behavior("laterl", folder)
