"""Hash of the whole state, to compare runs bit by bit."""

from __future__ import annotations

import hashlib

import numpy as np
from numpy.typing import NDArray

from crowdsim.crowd.state.components import BEND, DIGESTED, HASHED_AS
from crowdsim.crowd.state.digest_kernels import BASIS, digest_rows, digest_words
from crowdsim.ecs.world import World


def state_hash(world: World, environment: bytes, step: int, before: int) -> int:
    """Return a 64-bit hash of the whole state.

    Parameters
    ----------
    world : World
        All columns of all entities enter the hash, but for :data:`DIGESTED`.
    environment : bytes
        State of the environment.
    step : int
        Number of the step.
    before : int
        Hash of the step before, 0 at first.
    """
    parts = [before.to_bytes(8, "little") + step.to_bytes(8, "little"), environment]
    for name in world.column_names:
        if name not in DIGESTED:
            column = world.column(name)
            # Columns of records are large: use the faster hash.
            words = column.view(np.uint64) if column.dtype.names else None
            content = column.tobytes() if words is None else int(digest_words(words)).to_bytes(8, "little")
            parts += [HASHED_AS.get(name, name).encode(), content]
    # One call for all parts: each call releases the GIL and may then wait for other threads.
    return digest_of(b"".join(parts))


def rows_digest(world: World) -> int:
    """Return the sum of 64-bit digests of all rows modulo 2^64: it does not depend on their order.

    The sum of the results for several worlds is the result for all their rows together.
    """
    digests = np.full(world.count, BASIS)
    if not world.count:
        return 0
    for name in world.column_names:
        column = world.column(name)
        # Digests take words of 64 bits: narrower ones are widened.
        if column.dtype.itemsize % 8:
            column = column.astype(np.int64)
        digest_rows(np.ascontiguousarray(column).view(np.uint64).reshape(world.count, -1), digests)
    return int(digests.sum())


def chained_hash(digest: int, environment: bytes, step: int, before: int) -> int:
    """Return a 64-bit hash of all states up to a step, from the :func:`rows_digest` of its rows.

    The other arguments are those of :func:`state_hash`.
    """
    numbers = (before, step, digest)
    return digest_of(b"".join(number.to_bytes(8, "little") for number in numbers) + environment)


def timeline_digest(timeline: NDArray[np.float64]) -> int:
    """Return a 64-bit hash of a reserved timeline (K, SAMPLE), of the columns before BEND only; see BEND for why."""
    return digest_of(timeline[:, :BEND].tobytes())


def digest_of(content: bytes) -> int:
    """Return the BLAKE2b hash of ``content``, 64 bits long, as an integer."""
    return int.from_bytes(hashlib.blake2b(content, digest_size=8).digest(), "little")
