"""Contexts by which tracks are coded: classes of what came before, and where the models of each kind begin.

Arguments of all helpers are integers in units of a page: ``value``, a difference; ``size``, how large it is; ``turn``,
an angle.
"""

from crowdsim.export.page.tracks.range_kernels import WHOLE
from crowdsim.jit import helper

PLACE_BITS, TURN_BITS, NEAR_BITS, PHASE_BITS = 6, 7, 6, 6
"""Number of decisions by which an integer near 0 of steered people is coded: of places, turns, turns near the expected
one, and phases."""
OFF_BITS, ORIGIN_BITS, FRAME_BITS, CHANGE_BITS = 7, 8, 6, 8
"""The same of captured people: by how much a track is off from its node, where a node begins, frames within a node,
and frames across a change of nodes."""

CLASSES = 9
"""Classes of the size of a difference, :func:`size_class`, and of a difference with its sign, :func:`coarse_class`."""
SIGNED = 2 * CLASSES
"""Classes of a difference with its sign, :func:`signed_class`."""
MOST_ACROSS = 29
"""Difference on the first axis beyond which contexts of the second one no longer differ."""
PACES, WAYS = 16, 16
"""Classes of speeds, and of directions, as contexts of places."""
SPEEDS, TURNS, WANTED, NEARS = 24, 21, 49, 8
"""Contexts of headings and phases: classes of speeds (1/16 m/s wide), of turns, and of turns towards the direction of
motion; and which of the last 3 turns were counted from no turn, not from the expected one, as bits."""
KINDS, AWAYS = 7, 16
"""Contexts of phases: rule of the expected phase, and classes of the distance to the rear foot (2 cm wide)."""

# Where the models of each kind begin. The first ones are those of integers of any size: WHOLE for escapes, then for
# what begins a run of steps; twice WHOLE if its first two steps are coded in this way. Then those of decisions: whether
# a track is off (IS_OFF), whether a phase comes to a stand or stays (FOLLOWS), and which of the two (STAYS).
FIRST_X, FIRST_Y, FIRST_TURN, FIRST_FRAME, FIRST_PHASE = WHOLE, 3 * WHOLE, 5 * WHOLE, 7 * WHOLE, 8 * WHOLE
IS_OFF = 9 * WHOLE
OFF = IS_OFF + 4
ORIGIN = OFF + (3 << OFF_BITS)
FRAME = ORIGIN + (3 << ORIGIN_BITS)
CHANGE = FRAME + (SIGNED << FRAME_BITS)
FOLLOWS = CHANGE + (1 << CHANGE_BITS)
STAYS = FOLLOWS + 2 * KINDS
MODELS = STAYS + KINDS
"""Number of models of a chunk."""

# The same of models that are mixed. Each kind has three contexts, whose models begin one behind the other: as many as
# the context has classes, times two to the number of decisions.
X_MODELS = (0, SIGNED * CLASSES << PLACE_BITS, SIGNED * CLASSES + CLASSES**4 << PLACE_BITS)
_Y0 = X_MODELS[2] + (PACES * WAYS * 3 << PLACE_BITS)
_Y1 = _Y0 + (3 * 10 * (MOST_ACROSS + 1) << PLACE_BITS)
Y_MODELS = (_Y0, _Y1, _Y1 + (SIGNED * CLASSES**2 << PLACE_BITS))
_IS_NEAR0 = Y_MODELS[2] + (PACES * WAYS * SIGNED << PLACE_BITS)
_IS_NEAR1 = _IS_NEAR0 + (NEARS * SPEEDS * WANTED << 1)
IS_NEAR_MODELS = (_IS_NEAR0, _IS_NEAR1, _IS_NEAR1 + (NEARS * TURNS * WANTED << 1))
_NEAR0 = IS_NEAR_MODELS[2] + (NEARS * SPEEDS * SPEEDS << 1)
_NEAR1 = _NEAR0 + (SPEEDS << NEAR_BITS)
NEAR_MODELS = (_NEAR0, _NEAR1, _NEAR1 + (SPEEDS * TURNS << NEAR_BITS))
_TURN0 = NEAR_MODELS[2] + (NEARS * SPEEDS << NEAR_BITS)
_TURN1 = _TURN0 + (2 * TURNS << TURN_BITS)
TURN_MODELS = (_TURN0, _TURN1, _TURN1 + (WANTED * 8 << TURN_BITS))
_PHASE0 = TURN_MODELS[2] + (TURNS * TURNS << TURN_BITS)
_PHASE1 = _PHASE0 + (KINDS * SPEEDS * SIGNED << PHASE_BITS)
PHASE_MODELS = (_PHASE0, _PHASE1, _PHASE1 + (KINDS * TURNS * SIGNED << PHASE_BITS))
MIXED = PHASE_MODELS[2] + (KINDS * AWAYS * SPEEDS << PHASE_BITS)
"""Number of models of a chunk that are mixed."""

# Where the weights of each kind begin: as many rows as the classes by which they are chosen, if any, times two to the
# number of decisions.
X_ROW, Y_ROW = 0, CLASSES << PLACE_BITS
IS_NEAR_ROW = 2 * Y_ROW
NEAR_ROW = IS_NEAR_ROW + (NEARS << 1)
TURN_ROW = NEAR_ROW + (1 << NEAR_BITS)
PHASE_ROW = TURN_ROW + (1 << TURN_BITS)
ROWS = PHASE_ROW + (KINDS << PHASE_BITS)
"""Number of rows of weights of a chunk."""


@helper
def size_class(size):
    """Return the class, 0 to 8, of the size >= 0 of a difference: classes of small sizes are narrow."""
    if size <= 2:
        return size
    if size <= 4:
        return 3
    if size <= 7:
        return 4
    if size <= 11:
        return 5
    if size <= 17:
        return 6
    if size <= 24:
        return 7
    return 8


@helper
def signed_class(value):
    """Return the class, 0 to 17, of a difference with its sign."""
    return 2 * size_class(abs(value)) + (1 if value > 0 else 0)


@helper
def coarse_class(value):
    """Return the class, 0 to 8, of a difference with its sign, 4 for 0."""
    size = abs(value)
    kind = 0 if size == 0 else 1 if size <= 2 else 2 if size <= 5 else 3 if size <= 11 else 4
    return 4 + kind if value > 0 else 4 - kind


@helper
def turn_class(turn, most):
    """Return the class, 0 to 20, of a turn; ``most`` is the largest turn of a steered agent in a step."""
    return min(max(10 * turn // most, -10), 10) + 10
