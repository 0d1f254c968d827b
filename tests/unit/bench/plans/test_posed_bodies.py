"""Bodies posed along paths, and how deep they are in obstacles."""

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from crowdsim.bench.plans.posed_bodies import (
    Motions,
    Obstacles,
    Posed,
    Turn,
    Walk,
    posed_along,
    prism_distances,
    turns_along,
    walk_of,
)
from crowdsim.environment.mesh_solid import MeshSolid
from crowdsim.environment.solids import centered_box
from crowdsim.motion.clips.body_capsules import Capsules, body_capsules
from crowdsim.planning.labels.annotated_path import AnnotatedPath, Section, arc_lengths
from crowdsim.planning.labels.labelling_kernels import TURN_ROOM
from tests.unit.motion.walker import walk


def body(ends, legs=False, frames=3, radius=0.1) -> Capsules:
    """One capsule, the same in every frame."""
    return Capsules(np.broadcast_to(np.array(ends), (frames, 1, 2, 3)), np.array([radius]), np.array([legs]))


def still(capsules: Capsules, facing: float = 0.0) -> Walk:
    return Walk(capsules, np.array([0.0, 2.0, 4.0]), (1.0, 3.0), facing)


def path_through(points, *sections: Section) -> AnnotatedPath:
    places = np.array(points, np.float64)
    arc = arc_lengths(places)
    return AnnotatedPath(places, arc, sections or (Section(0, 0.0, float(arc[-1])),), float(arc[-1]))


def test_a_body_reaches_as_far_into_a_box_as_it_does():
    upright = Motions((still(body([[0.0, 0.2, 0.5], [0.0, 0.2, 1.5]])),), {})
    posed = posed_along(path_through([[0.0, 0.0], [4.0, 0.0]]), upright)
    for bottom, top, depth in ((0.0, 2.0, 0.03), (0.0, 0.05, -np.inf), (1.55, 2.0, 0.1 - np.hypot(0.07, 0.05))):
        box = centered_box("box", (2.0, 0.77), (1.0, 1.0), bottom, top, 0.0)
        other = centered_box("other", (2.0, 5.0), (1.0, 1.0), 0.0, 2.0, 0.0)
        assert Obstacles([box, other]).depths(posed).max() == pytest.approx(depth, abs=1e-9)


def test_legs_follow_the_way_around_a_corner_and_end_with_it():
    foot = [[0.5, 0.0, 0.1], [0.5, 0.0, 0.1]]
    corner = path_through([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0]])
    line = shapely.LineString(corner.points)

    def strays(legs, stiff):
        places = posed_along(corner, Motions((still(body(foot, legs)),), {}), stiff).places
        return shapely.distance(line, shapely.points(places[:, :2])).max()

    assert strays(legs=True, stiff=False) < 1e-9
    assert strays(legs=True, stiff=True) == pytest.approx(strays(legs=False, stiff=False))
    assert strays(legs=True, stiff=True) > 0.2


@given(st.floats(-3.0, 3.0), st.floats(0.3, 6.0))
def test_on_a_straight_way_bent_legs_are_as_captured_but_at_its_ends(bearing, length):
    step = [[0.0, 0.1, 0.9], [0.4, 0.1, 0.1]]
    way = np.array([np.cos(bearing), np.sin(bearing)])
    path = path_through([[1.0, 2.0], np.array([1.0, 2.0]) + length * way])
    motions = Motions((still(body(step, legs=True)),), {})
    bent, stiff = posed_along(path, motions), posed_along(path, motions, stiff=True)
    inside = bent.arc <= length - 0.4
    np.testing.assert_allclose(bent.places[inside], stiff.places[inside], atol=1e-9)
    assert ((bent.places[:, :2] - [1.0, 2.0]) @ way).max() <= length + 1e-9


def test_a_turn_is_made_in_the_middle_of_the_room_for_it():
    side = body([[0.0, 0.3, 1.2], [0.0, 0.3, 1.2]])
    into = Turn(side, np.array([0.0, 0.1, 0.3]), np.array([0.0, 0.5, 1.0]))
    back = Turn(side, np.array([0.0, 0.2, 0.5]), np.array([1.0, 0.5, 0.0]))
    motions = Motions((still(side, np.pi / 2.0), still(side)), {0: (into, back)})
    path = path_through([[0.0, 0.0], [6.0, 0.0]], Section(1, 0.0, 2.0), Section(0, 2.0, 3.0), Section(1, 3.0, 6.0))
    (_, first, begin, held), (_, second, end, kept) = turns_along(path, motions)
    assert (first, second) == (into, back)
    middle = 0.5 * (begin + begin + into.arc[-1])
    assert middle == pytest.approx(2.0 - 0.5 * TURN_ROOM)
    assert held == pytest.approx((begin + into.arc[-1], 2.0))
    assert end + 0.5 * back.arc[-1] == pytest.approx(3.0 + 0.5 * TURN_ROOM)
    assert kept == pytest.approx((3.0, end))
    posed = posed_along(path, motions)
    # A shoulder 0.3 m to the left is that much behind one who faces a quarter to the left, as along the whole section.
    offset = posed.places[:, 0] - posed.arc
    turned = (posed.arc > held[0]) & (posed.arc < kept[1])
    np.testing.assert_allclose(offset[turned], -0.3, atol=1e-9)
    assert np.abs(offset[(posed.arc < begin - 1e-9) | (posed.arc > end + back.arc[-1] + 1e-9)]).max() < 1e-9


def test_people_set_out_and_come_to_rest_as_their_clips_do():
    clip = walk(steps=6, turn=0.0)
    motions = Motions((walk_of(clip, 0.0),), {})
    length = motions.walks[0].arc[-1]
    posed = posed_along(path_through([[0.0, 0.0], [length, 0.0]]), motions, stiff=True)
    capsules = body_capsules(clip, 0, len(clip.root_positions)).ends
    for arc, frame in ((posed.arc.min(), 0), (posed.arc.max(), -1)):
        places = posed.places[posed.arc == arc]
        np.testing.assert_allclose(places[::5] - [arc, 0.0, 0.0], capsules[frame, :, 0], atol=1e-3)


def test_distances_from_an_upright_prism_are_negative_inside():
    square = shapely.box(-1.0, -1.0, 1.0, 1.0)
    places = np.array([[0.0, 0.0, 0.5], [0.9, 0.0, 0.5], [1.3, 0.0, 1.4], [0.0, 0.0, 1.2], [2.0, 0.0, 0.5]])
    above = np.maximum(-places[:, 2], places[:, 2] - 1.0)
    squares = np.full(len(places), square)
    distances = prism_distances(squares, shapely.boundary(squares), shapely.points(places[:, :2]), above)
    np.testing.assert_allclose(distances, [-0.5, -0.1, 0.5, 0.2, 1.0])


def test_a_solid_of_triangles_is_as_deep_as_its_slices():
    # A wedge 1 m high whose one side leans from x = 0 at the floor to x = 1 at the top.
    corners = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0], [1, 0, 1], [2, 0, 1], [2, 1, 1], [1, 1, 1]], float)
    quads = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
    triangles = np.array([[a, b, c] for a, b, c, _ in quads] + [[a, c, d] for a, _, c, d in quads])
    wedge = Obstacles([MeshSolid("wedge", corners, triangles)])
    places = np.array([[0.4, 0.5, 0.5], [0.2, 0.5, 0.5], [0.1, 0.5, 0.9]])
    true = 0.1 - (places[:, 2] - places[:, 0]) / np.sqrt(2.0)
    depths = wedge.depths(Posed(places, np.full(3, 0.1), np.zeros(3)))
    assert depths[0] == pytest.approx(true[0], abs=0.02)
    assert (depths[1:] == -np.inf).all()
