"""Hash of large arrays at the speed of memory."""

import numpy as np

from crowdsim.jit import kernel

FACTOR = np.uint64(0xFF51AFD7ED558CCD)
"""First multiplier of MurmurHash3's 64-bit finalizer: odd, and each bit of a word affects all higher bits."""

JOINING = np.uint64(0xC4CEB9FE1A85EC53)
"""Second multiplier of that finalizer."""

BASIS = np.uint64(0xCBF29CE484222325)
"""Initial value (offset basis of FNV-1a)."""
LANES = 4
"""Number of independent lanes."""


@kernel
def digest_words(words):
    """Return a 64-bit hash of ``words`` (uint64[n]); not for cryptography.

    Each word is combined by exclusive or, multiplied, and the high half is folded into the low one, as a multiplication
    carries bits upwards only.
    """
    first = BASIS
    second = BASIS + np.uint64(1)
    third = BASIS + np.uint64(2)
    fourth = BASIS + np.uint64(3)
    half = np.uint64(32)
    whole = len(words) - len(words) % LANES
    # Four lanes, so that a product need not wait for the one before.
    for n in range(0, whole, LANES):
        first = (first ^ words[n]) * FACTOR
        second = (second ^ words[n + 1]) * FACTOR
        third = (third ^ words[n + 2]) * FACTOR
        fourth = (fourth ^ words[n + 3]) * FACTOR
        first ^= first >> half
        second ^= second >> half
        third ^= third >> half
        fourth ^= fourth >> half
    # The remaining words, then the other lanes and the length, go into the first lane.
    for n in range(whole, len(words)):
        first = (first ^ words[n]) * FACTOR
        first ^= first >> half
    for lane in (second, third, fourth, np.uint64(len(words))):
        # Another factor: otherwise changes of the top bit of the last word of two lanes would cancel each other out.
        first = (first ^ (lane * JOINING)) * FACTOR
        first ^= first >> half
    return first


@kernel
def digest_rows(words, digests):
    """Update the 64-bit hash of each row in ``digests`` (uint64[n]) by the words of one of its columns, uint64[n, k].

    Call it for one column after the other; before the first, all digests are BASIS. The words of a row are taken one
    after the other. The end of a column counts, too (JOINING): the same words in other columns give another hash.
    """
    half = np.uint64(32)
    for row in range(len(words)):
        digest = digests[row]
        for k in range(words.shape[1]):
            digest = (digest ^ words[row, k]) * FACTOR
            digest ^= digest >> half
        digests[row] = digest * JOINING
