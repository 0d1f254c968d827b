"""A digest of large columns at the speed of memory."""

import numpy as np

from crowdsim.jit import kernel

FACTOR = np.uint64(0xFF51AFD7ED558CCD)
"""That of MurmurHash3's finalizer: odd, with bits all over, so that each bit of a word reaches all higher ones."""

JOINING = np.uint64(0xC4CEB9FE1A85EC53)
"""Its other one."""

BASIS = np.uint64(0xCBF29CE484222325)
LANES = 4


@kernel
def digest_words(words):
    """64 bits over ``words`` (uint64[n]): each is joined by exclusive or, multiplied, and its high half folded down.

    A multiplication carries bits upwards only, hence the folding. It is not for cryptography.
    """
    first = BASIS
    second = BASIS + np.uint64(1)
    third = BASIS + np.uint64(2)
    fourth = BASIS + np.uint64(3)
    half = np.uint64(32)
    whole = len(words) - len(words) % LANES
    # Four lanes do not wait for each other's products.
    for n in range(0, whole, LANES):
        first = (first ^ words[n]) * FACTOR
        second = (second ^ words[n + 1]) * FACTOR
        third = (third ^ words[n + 2]) * FACTOR
        fourth = (fourth ^ words[n + 3]) * FACTOR
        first ^= first >> half
        second ^= second >> half
        third ^= third >> half
        fourth ^= fourth >> half
    # The rest, and then the lanes, go through the first one.
    for n in range(whole, len(words)):
        first = (first ^ words[n]) * FACTOR
        first ^= first >> half
    for lane in (second, third, fourth, np.uint64(len(words))):
        # Times another factor, or a change of the top bit of a lane would look like one of the last word's.
        first = (first ^ (lane * JOINING)) * FACTOR
        first ^= first >> half
    return first
