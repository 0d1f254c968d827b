"""An adaptive binary range coder: few bytes for decisions whose outcome is likely.

Each decision has a model, two estimates of the probability that its outcome is 0: one that adapts within some 16
decisions, and one within some 128. Their mean is the probability used. Coding follows Martin (1979), with the carry of
LZMA. The viewer's twin is ``source/range_decoder.js``; both hold all numbers exactly.

Arguments of all helpers: ``state`` (5,) int64, the coder; ``out`` (n,) uint8, the bytes written so far, with room for
more; ``models`` (k, 2) uint16, the two estimates of each decision, of which ``model`` or ``first`` is a row; ``bit``, 0
or 1; ``value`` and ``leaf``, integers to be coded.
"""

from __future__ import annotations

import numpy as np

from crowdsim.jit import helper

LOW, RANGE, HELD, RUN, SIZE = range(5)
"""Entries of a coder's state: low end of its interval, its width, the byte that waits for a carry, the number of bytes
that wait (this one, and bytes of 255 after it), and the number of bytes written."""

EVEN = 1 << 15
"""Probability one half, in units of 1 / 65536."""
FAST, SLOW = 4, 7
"""Binary logarithms of the decisions within which the estimates adapt."""

WHOLE_BITS = 6
WHOLE = 1 << WHOLE_BITS
"""Number of decisions for length and sign of an integer of any size, and of their models."""

_TOP = 1 << 24
"""Width of the interval below which the highest byte of its low end is settled and written."""


def new_state() -> np.ndarray:
    """Return the state (5,) int64 of a coder that has written nothing."""
    return np.array([0, 0xFFFFFFFF, 0, 1, 0], np.int64)


@helper
def _carry_out(state, out):
    """Shift the low end by a byte; write the bytes that no later carry can change."""
    low = state[LOW]
    if low < 0xFF000000 or low > 0xFFFFFFFF:
        # Either no carry can come any more, or it has come: it runs through all bytes that wait.
        carry = low >> 32
        out[state[SIZE]] = (state[HELD] + carry) & 0xFF
        state[SIZE] += 1
        for _ in range(state[RUN] - 1):
            out[state[SIZE]] = (0xFF + carry) & 0xFF
            state[SIZE] += 1
        state[RUN] = 0
        state[HELD] = (low >> 24) & 0xFF
    state[RUN] += 1
    state[LOW] = (low & 0x00FFFFFF) << 8


@helper
def narrow(state, out, bound, bit):
    """Code a decision: outcome 0 takes the first part of the interval, ``bound`` wide, 1 the rest."""
    if bit == 0:
        state[RANGE] = bound
    else:
        state[LOW] += bound
        state[RANGE] -= bound
    while state[RANGE] < _TOP:
        state[RANGE] = (state[RANGE] << 8) & 0xFFFFFFFF
        _carry_out(state, out)


@helper
def put_bit(state, out, models, model, bit):
    """Code a decision with ``models[model]`` (uint16, uint16), which adapts."""
    fast = np.int64(models[model, 0])
    slow = np.int64(models[model, 1])
    narrow(state, out, (state[RANGE] >> 16) * ((fast + slow) >> 1), bit)
    if bit == 0:
        fast += (65536 - fast) >> FAST
        slow += (65536 - slow) >> SLOW
    else:
        fast -= fast >> FAST
        slow -= slow >> SLOW
    models[model, 0] = fast
    models[model, 1] = slow


@helper
def put_plain(state, out, value, bits):
    """Code the lowest ``bits`` bits of ``value``, a number >= 0; each bit is as likely 0 as 1 and needs no model."""
    # Halve the interval for each bit; whenever it is less than _TOP wide, a byte of its low end is settled.
    for place in range(bits - 1, -1, -1):
        state[RANGE] >>= 1
        if (value >> place) & 1:
            state[LOW] += state[RANGE]
        while state[RANGE] < _TOP:
            state[RANGE] = (state[RANGE] << 8) & 0xFFFFFFFF
            _carry_out(state, out)


@helper
def _put_leaf(state, out, models, first, bits, leaf):
    """Code a number of ``bits`` bits by the decisions of a binary tree, whose models begin at ``first``.

    The decisions are its bits from the highest to the lowest; the model of each depends on the bits above it. Node 1 is
    the root, node 0 is not used.
    """
    node = 1
    for place in range(bits - 1, -1, -1):
        bit = (leaf >> place) & 1
        put_bit(state, out, models, first + node, bit)
        node = 2 * node + bit


@helper
def put_whole(state, out, models, first, value):
    """Code an integer of a size below 2**31: its length in bits and its sign by models, then its bits without models.

    The WHOLE models of length and sign are a tree, which begins at ``first``.
    """
    size = abs(value)
    length = 0
    while size >> length:
        length += 1
    _put_leaf(state, out, models, first, WHOLE_BITS, 2 * length + (1 if value < 0 else 0))
    # The highest bit is 1, so only those below it are coded.
    if length > 1:
        put_plain(state, out, size, length - 1)


@helper
def put_number(state, out, models, first, bits, value):
    """Code an integer near 0 by ``bits`` decisions, whose models begin at ``first``; other integers after an escape.

    Integers from 1 - 2**(bits - 1) to 2**(bits - 1) - 1 are near 0; leaf 0 is the escape. All escapes share the first
    WHOLE models.
    """
    half = 1 << (bits - 1)
    near = -half < value < half
    _put_leaf(state, out, models, first, bits, value + half if near else 0)
    if not near:
        put_whole(state, out, models, 0, value)


@helper
def finish(state, out):
    """Write what is left; return the number of bytes."""
    # The byte that waits, and the four of the low end.
    for _ in range(5):
        _carry_out(state, out)
    return state[SIZE]
