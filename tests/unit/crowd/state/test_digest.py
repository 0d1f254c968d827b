"""The digest of a column tells every change of a bit, an exchange of words, and more words from fewer."""

import numpy as np
import pytest

from crowdsim.crowd.state.digest_kernels import BASIS, FACTOR, JOINING, LANES, digest_rows, digest_words

MASK = (1 << 64) - 1


def plain_digest(words: list[int]) -> int:
    """The same in Python's own integers."""
    lanes = [int(BASIS) + lane for lane in range(LANES)]
    whole = len(words) - len(words) % LANES
    for n, word in enumerate(words):
        lane = n % LANES if n < whole else 0
        lanes[lane] = ((lanes[lane] ^ word) * int(FACTOR)) & MASK
        lanes[lane] ^= lanes[lane] >> 32
    first = lanes[0]
    for word in (*lanes[1:], len(words)):
        first = ((first ^ (word * int(JOINING) & MASK)) * int(FACTOR)) & MASK
        first ^= first >> 32
    return first


@pytest.mark.parametrize("count", [0, 1, 3, 4, 5, 8, 1001])
def test_it_is_that_of_plain_integers(count: int) -> None:
    words = np.random.default_rng(count).integers(0, 1 << 63, count).astype(np.uint64)
    assert int(digest_words(words)) == plain_digest(words.tolist())


@pytest.mark.parametrize("count", [1, 7, 64])
def test_every_bit_counts(count: int) -> None:
    words = np.random.default_rng(count).integers(0, 1 << 63, count).astype(np.uint64)
    before = int(digest_words(words))
    seen = {before}
    for word in range(count):
        for bit in range(64):
            changed = words.copy()
            changed[word] ^= np.uint64(1 << bit)
            seen.add(int(digest_words(changed)))
    assert len(seen) == 1 + 64 * count


def test_order_and_length_count() -> None:
    words = np.arange(1, 17, dtype=np.uint64)
    assert digest_words(words) != digest_words(words[::-1].copy())
    assert digest_words(np.zeros(4, np.uint64)) != digest_words(np.zeros(8, np.uint64))


def plain_row_digest(words: list[int]) -> int:
    digest = int(BASIS)
    for word in words:
        digest = (digest ^ word) * int(FACTOR) % 2**64
        digest ^= digest >> 32
    return digest * int(JOINING) % 2**64


def test_rows_have_digests_of_their_own():
    words = np.random.default_rng(4).integers(0, 2**64, (9, 5), np.uint64)
    digests = np.full(9, BASIS)
    digest_rows(words, digests)
    assert digests.tolist() == [plain_row_digest(row) for row in words.tolist()]


@pytest.mark.parametrize("columns", [(0, 1), (1, 4)])
def test_two_signs_that_change_together_change_the_digest(columns):
    words = np.random.default_rng(5).integers(0, 2**64, (2, 5), np.uint64)
    words[1] = words[0]
    words[1, list(columns)] ^= np.uint64(1 << 63)
    digests = np.full(2, BASIS)
    digest_rows(words, digests)
    assert digests[0] != digests[1]
