"""A body that goes over from one deformed clip to another while it walks on."""

from __future__ import annotations

import numpy as np

from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.kinematics import Floats, unit
from crowdsim.motion.deformed.body_kernels import PHASE
from crowdsim.motion.deformed.deformed_clip import ClipModel, DeformedClip
from crowdsim.motion.deformed.joined_tracks import STEP
from crowdsim.motion.deformed.step_plan import plan_steps, pose_at

_ROTATIONS = ("mean", "turns")
_MIXED = ("swings", "waves", "root", "hips", "bones", "pitch", "lift", "prints")
_NUMBERS = ("stride", "stand", "width")
"""Fields of a ClipModel that differ between clips on one skeleton: quaternions, other arrays, and numbers. The others
number joints, so they are the same."""


def smooth_share(share: Floats) -> Floats:
    """Return values that rise smoothly from 0 to 1 as ``share`` does, flat at both ends and constant beyond."""
    within = np.clip(share, 0.0, 1.0)
    smooth: Floats = within * within * (3.0 - 2.0 * within)
    return smooth


def go_over(
    before: DeformedClip, after: DeformedClip, track: Floats, phases: tuple[float, float], times: Floats, name: str
) -> Clip:
    """Pose a body on a track as ``before``, then between both, then as ``after``; return a clip with the name ``name``.

    Each footstep is mixed once, by the phase near the middle of its stance, so feet that stand do not slide. The rest
    of the body is mixed anew at each time.

    Parameters
    ----------
    before, after : clips on one skeleton
    track : (n, 4) x, y [m], heading [rad] and phase [cycles], as for plan_steps, STEP seconds apart
    phases : phase until which the body is ``before``, and the later one from which it is ``after`` [cycles]
    times : (F,) times of the clip's frames, after the first sample of the track [s]
    """

    def weigh(at: Floats) -> Floats:
        """Return the share of ``after`` at phases ``at`` [cycles]."""
        return smooth_share((at - phases[0]) / (phases[1] - phases[0]))

    # Both plans have the same rows, as these depend on the phases of the track alone. A quarter of
    # a cycle after its landing, the body passes over the foot.
    one, two = plan_steps(before, [track]), plan_steps(after, [track])
    steps = weigh(0.5 * (one.halves[0] + np.arange(len(one.steps))) + 0.25)[:, None]
    samples = weigh(one.samples[:, PHASE])[:, None]
    plan = one._replace(
        steps=one.steps + steps * (two.steps - one.steps),
        samples=one.samples + samples * (two.samples - one.samples),
    )
    shares = weigh(np.interp(times, np.arange(len(track)) * STEP, track[:, 3]))
    roots, rotations = np.empty((len(times), 3)), np.empty((len(times), before.skeleton.joint_count, 4))
    for row, share in enumerate(shares.tolist()):
        body = DeformedClip(name, before.skeleton, _between(before.model, after.model, share))
        roots[row], rotations[row] = (
            each[0] for each in pose_at(body, plan, np.zeros(1, np.int64), times[row : row + 1])
        )
    return Clip(name, before.skeleton, roots, rotations)


def _between(a: ClipModel, b: ClipModel, share: float) -> ClipModel:
    """Return the model that is ``share`` (0 to 1) of the way from ``a`` to ``b``, two models of one skeleton."""
    mixed = {key: getattr(a, key) + share * (getattr(b, key) - getattr(a, key)) for key in (*_MIXED, *_NUMBERS)}
    for key in _ROTATIONS:
        p, q = getattr(a, key), getattr(b, key)
        # q and -q are the same rotation: take the one on the side of p.
        q = np.where(np.sum(p * q, axis=-1, keepdims=True) < 0.0, -q, q)
        mixed[key] = unit((1.0 - share) * p + share * q)
    return a._replace(**mixed)
