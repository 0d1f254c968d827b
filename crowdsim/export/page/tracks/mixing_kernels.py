"""Code numbers near 0 by decisions whose probabilities are mixed of several models: good models get larger weights.

Each decision has INPUTS contexts, and a model in each of them: the probability that the outcome is 1. After an outcome,
a model moves towards it by the share 1 / (decisions so far + 1.5), but no less than 1 / 128.5: so rare contexts are
learned fast. The logits of the probabilities are added, times weights that adapt as well (logistic mixing: Mattern,
Proc. Data Compression Conference, 2012). All numbers are integers, so that the viewer's twin, ``source/mixing.js``,
finds the same.

Arguments of all helpers: ``state``, ``out`` and ``models`` of the coder, as of
:mod:`crowdsim.export.page.tracks.range_kernels`; ``mixer`` (:class:`Mixer`) models and weights; ``at`` (INPUTS
integers) the first model of each context; ``row`` the first row of weights; ``bits`` the number of decisions. A number
takes 2**bits models of each context, and as many rows.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.export.page.tracks.range_kernels import EVEN, RANGE, narrow, put_whole
from crowdsim.jit import helper

INPUTS = 3
"""Number of contexts of a decision."""

_CHANCE_BITS = 12
_CHANCES = 1 << _CHANCE_BITS
"""Units of probabilities that are mixed: 1 / 4096."""
_MOST = 2047
"""Largest logit, in units of 1 / 256."""
_WEIGHT_BITS = 16
_FIRST_WEIGHT = round(1.4 / INPUTS * (1 << _WEIGHT_BITS))
"""Weight of each model at first: together more than 1, as contexts know different things."""
_LEARNING = 24
"""How fast weights adapt. Larger: faster, but less exactly."""
_LARGEST = (1 << 18) - 1
"""Largest weight: the sum of three logits times their weights stays within 32 bits."""
_PATIENCE = 127
"""Number of decisions after which a model adapts no slower."""

# Chances of the logits -2048, -1920, ... 2048: 4096 / (1 + exp(-logit / 256)), rounded down. Between these points,
# straight lines.
_POINTS = (1, 2, 3, 6, 10, 16, 27, 45, 73, 120, 194, 310, 488, 747, 1101, 1546, 2047, 2549, 2994, 3348, 3607, 3785)
_POINTS = (*_POINTS, 3901, 3975, 4022, 4050, 4068, 4079, 4085, 4089, 4092, 4093, 4094)


def _chances_of_logits() -> NDArray[np.int64]:
    """Return the chance of each logit from -_MOST to _MOST."""
    logits = np.arange(-_MOST, _MOST + 1)
    # The point below each logit, and how far it is on the way to the next, in 128ths.
    index, share = (logits >> 7) + 16, logits & 127
    points = np.array(_POINTS)
    chances: NDArray[np.int64] = (points[index] * (128 - share) + points[index + 1] * share + 64) >> 7
    return chances


_CHANCE = _chances_of_logits()
_LOGIT = np.minimum(np.searchsorted(_CHANCE, np.arange(_CHANCES)), 2 * _MOST) - _MOST
"""Logit of each chance: the least one that gives it or a greater one."""
_SHARE = np.rint(32768 / (np.arange(_PATIENCE + 1) + 1.5)).astype(np.int64)
"""By how much a model adapts after so many decisions, in units of 1 / 32768."""


class Mixer(NamedTuple):
    """M models of decisions that are mixed, and W rows of weights.

    chances: (M,) uint16 probability of 1 of each model, in units of 1 / 65536. counts: (M,) uint8, decisions so far, up
    to _PATIENCE. weights: (W, INPUTS) int32, in units of 1 / 65536.
    """

    chances: NDArray[np.uint16]
    counts: NDArray[np.uint8]
    weights: NDArray[np.int32]


class Coder(NamedTuple):
    """A range coder: its state, the bytes that it writes (B,) uint8, and the models of decisions, mixed ones apart.

    ``state`` and ``models`` are those of :mod:`crowdsim.export.page.tracks.range_kernels`.
    """

    state: NDArray[np.int64]
    out: NDArray[np.uint8]
    models: NDArray[np.uint16]
    mixer: Mixer


def new_mixer(models: int, rows: int) -> Mixer:
    """Return a mixer of so many ``models`` and ``rows`` of weights, which has seen no decision."""
    chances = np.full(models, EVEN, np.uint16)
    return Mixer(chances, np.zeros(models, np.uint8), np.full((rows, INPUTS), _FIRST_WEIGHT, np.int32))


@helper
def _learn(mixer, model, bit):
    """Move the model with the number ``model`` by its share towards an outcome, ``bit``."""
    count = mixer.counts[model]
    chance = np.int64(mixer.chances[model])
    mixer.chances[model] = chance + (((65535 if bit else 0) - chance) * _SHARE[count] >> 15)
    if count < _PATIENCE:
        mixer.counts[model] = count + 1


@helper
def put_leaf(state, out, mixer, at, row, bits, leaf):
    """Code ``leaf``, a number of ``bits`` bits, by decisions of a binary tree, from its highest bit to its lowest.

    Node 1 is the root; nodes 2 n and 2 n + 1 follow node n. Each has a model of each context, and a row of weights.
    """
    node = 1
    for place in range(bits - 1, -1, -1):
        bit = (leaf >> place) & 1
        # Logits of the three models: their chances have 16 bits, those of the tables 12.
        a = _LOGIT[mixer.chances[at[0] + node] >> 4]
        b = _LOGIT[mixer.chances[at[1] + node] >> 4]
        c = _LOGIT[mixer.chances[at[2] + node] >> 4]
        weights = mixer.weights[row + node]
        logit = (weights[0] * a + weights[1] * b + weights[2] * c) >> _WEIGHT_BITS
        chance = _CHANCE[min(max(logit, -_MOST), _MOST) + _MOST]
        narrow(state, out, (state[RANGE] >> _CHANCE_BITS) * (_CHANCES - chance), bit)
        # Weights follow the gradient of the code length: logit times error. Adding 0x8000 rounds.
        off = ((bit << _CHANCE_BITS) - chance) * _LEARNING
        weights[0] = min(max(weights[0] + ((a * off + 0x8000) >> 16), -_LARGEST), _LARGEST)
        weights[1] = min(max(weights[1] + ((b * off + 0x8000) >> 16), -_LARGEST), _LARGEST)
        weights[2] = min(max(weights[2] + ((c * off + 0x8000) >> 16), -_LARGEST), _LARGEST)
        _learn(mixer, at[0] + node, bit)
        _learn(mixer, at[1] + node, bit)
        _learn(mixer, at[2] + node, bit)
        node = 2 * node + bit


@helper
def put_mixed(state, out, models, mixer, at, row, bits, value):
    """Code ``value`` near 0, from 1 - 2**(bits - 1) to 2**(bits - 1) - 1; other integers after leaf 0, an escape."""
    half = 1 << (bits - 1)
    near = -half < value < half
    put_leaf(state, out, mixer, at, row, bits, value + half if near else 0)
    if not near:
        put_whole(state, out, models, 0, value)
