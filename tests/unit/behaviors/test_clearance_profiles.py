"""Profiles of the behaviors that come with the engine: measured, written, drawn."""

import numpy as np
import pytest

from crowdsim.behaviors.clearance_profiles import (
    PROFILE_FILE,
    ClearanceProfile,
    draw_profiles,
    measure_profile,
    representative_heights,
    write_profile,
)
from crowdsim.errors import BehaviorError
from crowdsim.library import library_folder

NAMES = ("lateral", "arm_constrained", "frontal")


@pytest.fixture(scope="module")
def profiles():
    return [measure_profile(name, library_folder("behaviors")) for name in NAMES]


def at(profile: ClearanceProfile, height: float) -> float:
    return float(np.interp(height, profile.heights, profile.diameters))


def test_behaviors_differ_at_the_arms_and_hardly_at_the_shins(profiles):
    lateral, held, frontal = profiles
    assert at(lateral, 1.0) + 0.1 < at(held, 1.2) < at(frontal, 1.0)
    assert at(frontal, 1.0) > at(held, 1.0) + 0.1
    assert at(held, 0.3) == pytest.approx(at(frontal, 0.3), abs=0.03)
    assert all(profile.diameters[-1] == 0.0 for profile in profiles)
    for profile in profiles:
        assert (np.diff(profile.quartiles, axis=0) >= 0.0).all()
        assert (profile.quartiles[2] <= profile.diameters + 1e-12).all()


def test_a_behavior_without_clips_says_so(tmp_path):
    folder = tmp_path / "strolling"
    folder.mkdir()
    text = "name: strolling\ndescription: As captured.\ncost_per_meter: 1.0\nspeed: 1.0\ncolor: '#1f77b4'\n"
    (folder / "behavior.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(BehaviorError, match="lists no clips"):
        measure_profile("strolling", tmp_path)


def test_layers_are_represented_where_the_widest_is_widest():
    heights = np.array([0.1, 0.3, 0.5, 1.0, 1.2, 1.4])
    narrow, wide = np.array([0.3, 0.2, 0.2, 0.3, 0.3, 0.3]), np.array([0.2, 0.4, 0.4, 0.5, 0.6, 0.4])
    made = [ClearanceProfile(n, "#000000", heights, d, np.zeros((3, 6))) for n, d in (("a", narrow), ("b", wide))]
    assert representative_heights(made, [(0.1, 0.6), (0.8, 1.5), (1.6, 1.8)]) == (0.3, 1.2, pytest.approx(1.7))


@pytest.mark.parametrize("name", NAMES)
def test_the_profiles_beside_the_behaviors_are_current(profiles, name, tmp_path):
    (tmp_path / name).mkdir()
    fresh = write_profile(profiles[NAMES.index(name)], tmp_path)
    shipped = library_folder("behaviors") / name / PROFILE_FILE
    assert shipped.read_text() == fresh.read_text(), "run tools/build_default_motion.py"


def test_the_picture_names_behaviors_and_layers(profiles):
    figure = draw_profiles(profiles, [("legs", 0.1, 2.0), ("torso", 0.8, 1.5)])
    axes = figure.axes[0]
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["lateral", "arm constrained", "frontal"]
    assert [text.get_text() for text in axes.texts] == ["legs, 0.60 m", "torso, 0.90 m"]
