"""One number for the whole state, to compare runs bit by bit."""

from __future__ import annotations

import hashlib

from crowdsim.crowd.components import DIGESTED
from crowdsim.ecs.world import World


def state_hash(world: World, place: bytes, step: int, before: int) -> int:
    """64 bits over every column of every entity, the place, the step, and the hash of the step before (0 at first)."""
    digest = hashlib.blake2b(digest_size=8)
    digest.update(before.to_bytes(8, "little") + step.to_bytes(8, "little"))
    digest.update(place)
    for name in world.column_names:
        if name not in DIGESTED:
            digest.update(name.encode())
            digest.update(world.column(name).tobytes())
    return int.from_bytes(digest.digest(), "little")


def digest_of(content: bytes) -> int:
    """64 bits that stand for the content."""
    return int.from_bytes(hashlib.blake2b(content, digest_size=8).digest(), "little")
