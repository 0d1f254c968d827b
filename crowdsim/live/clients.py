"""The pages that watch a session, each with a short queue of what is to be sent to it."""

from __future__ import annotations

import asyncio
from collections import deque

MOST_PICTURES = 8
"""Largest number of pictures that wait for a page; older ones are lost."""


class Client:
    """Queue of one page: the last message of each kind (things, state), and a few pictures."""

    def __init__(self, things: str | None, state: str | None, picture: bytes | None) -> None:
        self._messages: dict[str, str | None] = {"things": things, "state": state}
        self._pictures: deque[bytes] = deque([] if picture is None else [picture], MOST_PICTURES)
        self._something = asyncio.Event()
        self._something.set()

    def put(self, kind: str, message: str) -> None:
        """Queue a message of a kind, things or state, in place of a waiting one of this kind: only the last counts."""
        self._messages[kind] = message
        self._something.set()

    def put_picture(self, content: bytes) -> None:
        """Queue a picture; the oldest one is lost if MOST_PICTURES wait."""
        self._pictures.append(content)
        self._something.set()

    async def next(self) -> str | bytes:
        """Return what is to be sent next: things, then state, then pictures in turn; wait if there is nothing."""
        while True:
            for kind, message in self._messages.items():
                if message is not None:
                    self._messages[kind] = None
                    return message
            if self._pictures:
                return self._pictures.popleft()
            self._something.clear()
            await self._something.wait()


class Audience:
    """All pages; its methods run in the server's thread."""

    def __init__(self) -> None:
        self.clients: set[Client] = set()
        self._last: dict[str, str | None] = {"things": None, "state": None}
        self._picture: bytes | None = None

    def join(self) -> Client:
        """Return the queue of a new page, with the last things, state and picture in it."""
        client = Client(self._last["things"], self._last["state"], self._picture)
        self.clients.add(client)
        return client

    def leave(self, client: Client) -> None:
        """Forget a page."""
        self.clients.discard(client)

    def tell(self, kind: str, message: str) -> None:
        """Give all pages a message of a kind, things or state."""
        self._last[kind] = message
        for client in self.clients:
            client.put(kind, message)

    def show(self, content: bytes) -> None:
        """Give all pages a picture."""
        self._picture = content
        for client in self.clients:
            client.put_picture(content)
