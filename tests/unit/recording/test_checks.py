"""Headers whose skeleton or gaits fit nothing are refused, with a message that names what is wrong."""

from dataclasses import replace

import numpy as np
import pytest

from crowdsim.errors import RecordingError
from crowdsim.recording.checks import check_header
from tests.support.small_recording import small_header
from tests.unit.recording.test_steered_columns import steered_header


def refused(header, motion):
    """Return the message with which a header with another motion is refused."""
    with pytest.raises(RecordingError) as error:
        check_header(replace(header, motion=motion))
    return str(error.value)


@pytest.mark.parametrize("joint", [1, 18])
def test_a_skeleton_has_one_root(joint):
    header = small_header()
    parents = header.motion.skeleton.parents.copy()
    parents[joint] = -1
    skeleton = replace(header.motion.skeleton, parents=parents)
    message = refused(header, replace(header.motion, skeleton=skeleton))
    assert message == "motion.parents: each joint but the first needs a parent before it"


def test_a_skeleton_of_one_joint_is_one():
    header = small_header()
    skeleton = replace(
        header.motion.skeleton,
        names=("hips",),
        parents=np.array([-1], np.int32),
        offsets=np.zeros((1, 3)),
        end_parents=np.zeros(0, np.int32),
        end_offsets=np.zeros((0, 3)),
        roles={},
    )
    pool = header.motion.pool_rotations[:, :1]
    check_header(replace(header, motion=replace(header.motion, skeleton=skeleton, pool_rotations=pool)))


@pytest.mark.parametrize("shape", [(), (1, 1)])
def test_end_parents_of_another_shape_are_named(shape):
    header = small_header()
    skeleton = replace(header.motion.skeleton, end_parents=np.zeros(shape, np.int32))
    message = refused(header, replace(header.motion, skeleton=skeleton))
    assert message == f"motion.end_parents has shape {shape}, not (K,)"


def test_offsets_that_are_no_numbers_are_named():
    header = small_header()
    skeleton = replace(header.motion.skeleton, offsets=header.motion.skeleton.offsets * np.nan)
    message = refused(header, replace(header.motion, skeleton=skeleton))
    assert message == "motion.offsets holds values of float64 that are not all finite numbers"


@pytest.mark.parametrize(
    ("rows", "scale", "message"),
    [
        (1, 1.0, "needs two or more poses, as bodies are posed between them; it has 1"),
        (0, 1.0, "needs two or more poses, as bodies are posed between them; it has 0"),
        (5, np.inf, "has values that are not finite"),
    ],
)
def test_a_gait_needs_two_finite_poses(rows, scale, message):
    header = steered_header()
    first = header.motion.gaits[0]
    gait = replace(first, root=(first.root + 1.0)[:rows] * np.float32(scale), rotations=first.rotations[:rows])
    gaits = (gait, *header.motion.gaits[1:])
    assert refused(header, replace(header.motion, gaits=gaits)) == f"gait '{first.name}' {message}"
