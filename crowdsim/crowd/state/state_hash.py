"""One number for the whole state, to compare runs bit by bit."""

from __future__ import annotations

import hashlib

import numpy as np

from crowdsim.crowd.state.components import DIGESTED, HASHED_AS
from crowdsim.crowd.state.digest_kernels import digest_words
from crowdsim.ecs.world import World


def state_hash(world: World, environment: bytes, step: int, before: int) -> int:
    """64 bits over every column of every entity, the environment, the step, and the hash before it (0 at first)."""
    parts = [before.to_bytes(8, "little") + step.to_bytes(8, "little"), environment]
    for name in world.column_names:
        if name not in DIGESTED:
            column = world.column(name)
            # Records are large.
            words = column.view(np.uint64) if column.dtype.names else None
            content = column.tobytes() if words is None else int(digest_words(words)).to_bytes(8, "little")
            parts += [HASHED_AS.get(name, name).encode(), content]
    # As one, as it lets other threads run meanwhile, and would wait for them after each.
    return digest_of(b"".join(parts))


def digest_of(content: bytes) -> int:
    """64 bits that stand for the content."""
    return int.from_bytes(hashlib.blake2b(content, digest_size=8).digest(), "little")
