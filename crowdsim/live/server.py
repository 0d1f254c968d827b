"""The server of a live simulation: the page over HTTP and a WebSocket, on one port, in a thread of its own."""

from __future__ import annotations

import asyncio
import contextlib
import hmac
import http
import secrets
import socket
import threading
from collections.abc import Callable
from typing import Self
from urllib.parse import parse_qs, urlsplit

from websockets.asyncio.server import Server as SocketServer
from websockets.asyncio.server import ServerConnection, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request as HttpRequest
from websockets.http11 import Response

from crowdsim.errors import CrowdSimError
from crowdsim.live.clients import Audience, Client
from crowdsim.live.pictures import text
from crowdsim.live.requests import MOST_BYTES, Request, RequestRefused, number_of, read_request
from crowdsim.live.session import Answer

MOST_PAGES = 16
"""Largest number of pages that watch at once."""

_LOOPBACK = ("127.0.0.1", "localhost", "::1")
_ANYWHERE = ("0.0.0.0", "::")
_SOCKET = "/live"
_PAGE = "/"

Ask = Callable[[Request], Answer]


class Server:
    """Context manager that serves a page and its messages; a :class:`~crowdsim.live.session.Publisher`.

    Parameters
    ----------
    page : bytes
        The page.
    opening : bytes
        First message to every page.
    host, port : str, int
        Address to listen at; port 0 takes any that is free.
    ask : callable or None
        Takes a request, in the server's thread, and returns the future of its answer. Requests are refused as long as
        it is None.

    Raises
    ------
    CrowdSimError
        If the server cannot listen at the address.
    """

    def __init__(self, page: bytes, opening: bytes, host: str, port: int, ask: Ask | None = None) -> None:
        self._page, self._opening = page, opening
        self._host, self._port = host, port
        self.ask = ask
        self.token = secrets.token_urlsafe(18)
        self._audience = Audience()
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._run, name="crowdsim-live", daemon=True)
        self._ready = threading.Event()
        self._failure: OSError | None = None
        self._end: asyncio.Event | None = None

    @property
    def address(self) -> str:
        """Return the address of the page, with the token; if all may connect, with the name of this machine."""
        return self._address(socket.gethostname() if self._host in _ANYWHERE else self._host)

    @property
    def local_address(self) -> str:
        """Return the address of the page on this machine."""
        return self._address("127.0.0.1" if self._host in _ANYWHERE else self._host)

    def _address(self, host: str) -> str:
        """Return the address of the page at ``host``, with the token; numbers of IPv6 stand in brackets."""
        host = f"[{host}]" if ":" in host else host
        return f"http://{host}:{self._port}{_PAGE}?token={self.token}"

    def __enter__(self) -> Self:
        self._thread.start()
        self._ready.wait()
        if self._failure is not None:
            self._thread.join()
            raise CrowdSimError(
                f"cannot listen at {self._host}:{self._port} ({self._failure.strerror or self._failure}); "
                "choose another --port or --host"
            )
        return self

    def __exit__(self, *_: object) -> None:
        with contextlib.suppress(RuntimeError):  # the loop has ended by itself
            self._loop.call_soon_threadsafe(self._stop)
        self._thread.join()

    def picture(self, content: bytes) -> None:
        """Publish a picture of the agents in a step."""
        self._loop.call_soon_threadsafe(self._audience.show, content)

    def things(self, message: str) -> None:
        """Publish doors and movables as they are now."""
        self._loop.call_soon_threadsafe(self._audience.tell, "things", message)

    def state(self, message: str) -> None:
        """Publish pause, speed, end, and the groups that can be added to."""
        self._loop.call_soon_threadsafe(self._audience.tell, "state", message)

    def _run(self) -> None:
        """Serve until the server is closed; this is the body of its thread."""
        try:
            self._loop.run_until_complete(self._serve())
        finally:
            self._loop.close()
            self._ready.set()  # also if it failed, as the other thread waits for it

    async def _serve(self) -> None:
        """Serve on the port until the end; keep the error if that is not possible."""
        self._end = asyncio.Event()
        try:
            server = await self._listening()
        except OSError as error:
            self._failure = error
            return
        async with server:
            self._port = next(iter(server.sockets)).getsockname()[1]
            self._ready.set()
            await self._end.wait()

    async def _listening(self) -> SocketServer:
        """Open the port; return the server that listens there."""
        return await serve(
            self._talk,
            self._host,
            self._port,
            process_request=self._answer_http,
            compression=None,  # pictures differ from step to step
            # Buffers are small: `_send` soon waits for a slow page, and its Client drops pictures instead.
            max_size=MOST_BYTES,
            max_queue=4,
            write_limit=65_536,
            open_timeout=10,
            ping_interval=20,
            close_timeout=1,
            server_header=None,
        )

    def _stop(self) -> None:
        """End serving, in the server's thread; do nothing if serving never began."""
        if self._end is not None:
            self._end.set()

    def _answer_http(self, connection: ServerConnection, request: HttpRequest) -> Response | None:
        """Return an answer over HTTP, the page or a refusal; None opens the WebSocket.

        Other sites must not lead a browser here, so the header Host, and for the WebSocket also Origin, must be this
        server's. The token keeps out people to whom the address was not given.
        """
        parts = urlsplit(request.path)
        token = parse_qs(parts.query).get("token", [""])[-1]
        if not self._is_served(_header(request, "Host")):
            return _refusal(http.HTTPStatus.FORBIDDEN, "this server is not known under that name")
        if not hmac.compare_digest(token.encode(), self.token.encode()):
            return _refusal(http.HTTPStatus.FORBIDDEN, "wrong token: open the address that 'crowdsim serve' printed")
        if parts.path == _PAGE and _header(request, "Upgrade") == "":
            return _page(self._page)
        if parts.path != _SOCKET:
            return _refusal(http.HTTPStatus.NOT_FOUND, "there is no such page")
        if _header(request, "Origin") != f"http://{_header(request, 'Host')}":
            return _refusal(http.HTTPStatus.FORBIDDEN, "only the page of this server may connect")
        if len(self._audience.clients) >= MOST_PAGES:
            return _refusal(http.HTTPStatus.SERVICE_UNAVAILABLE, f"{MOST_PAGES} pages watch already; close one")
        return None

    def _is_served(self, host: str) -> bool:
        """Return whether ``host``, a header Host, names this server.

        Names of other sites are refused, unless the server listens on all addresses: then it may have any name.
        """
        try:
            name = urlsplit(f"//{host}").hostname
        except ValueError:
            return False
        return name in _LOOPBACK or name == self._host.lower() or (name is not None and self._host in _ANYWHERE)

    async def _talk(self, connection: ServerConnection) -> None:
        """Serve the WebSocket of one page, in both directions, until the page has gone."""
        client = self._audience.join()
        # When the connection ends, the sender may wait for a picture, and the listener for an answer: neither notices.
        # So the third task waits for the end itself.
        tasks = [
            asyncio.create_task(self._send(connection, client)),
            asyncio.create_task(self._listen(connection)),
            asyncio.create_task(connection.wait_closed()),
        ]
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            self._audience.leave(client)
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    async def _send(self, connection: ServerConnection, client: Client) -> None:
        """Send a page the opening, then the messages of its queue, until the page has gone."""
        with contextlib.suppress(ConnectionClosed):
            await connection.send(self._opening)
            while True:
                await connection.send(await client.next())

    async def _listen(self, connection: ServerConnection) -> None:
        """Answer one message after the other; read no more from a page that does not take the answers."""
        with contextlib.suppress(ConnectionClosed):
            async for message in connection:
                await connection.send(await self._answer(message))

    async def _answer(self, message: str | bytes) -> str:
        """Give a request to the session; return the message that answers it."""
        number = number_of(message)
        try:
            request = read_request(message)
            if self.ask is None:
                raise RequestRefused("the simulation has not begun; try again")
            facts = await asyncio.wrap_future(self.ask(request))
        except RequestRefused as refused:
            return text("answer", id=number, ok=False, words=str(refused))
        return text("answer", id=number, ok=True, **facts)


def _header(request: HttpRequest, name: str) -> str:
    """Return the value of a header, or an empty text if it is missing or given several times."""
    values = request.headers.get_all(name)
    return values[0] if len(values) == 1 else ""


def _page(content: bytes) -> Response:
    """Return an answer with the page; its headers forbid copies, and passing on the address with the token."""
    headers = Headers(
        {
            "Content-Type": "text/html; charset=utf-8",
            "Content-Length": str(len(content)),
            "Cache-Control": "no-store",
            "Referrer-Policy": "no-referrer",
            "X-Content-Type-Options": "nosniff",
            "X-Frame-Options": "DENY",
            "Connection": "close",
        }
    )
    return Response(http.HTTPStatus.OK.value, http.HTTPStatus.OK.phrase, headers, content)


def _refusal(status: http.HTTPStatus, words: str) -> Response:
    """Return an answer that refuses a request in words."""
    content = f"{words}\n".encode()
    headers = Headers(
        {"Content-Type": "text/plain; charset=utf-8", "Content-Length": str(len(content)), "Connection": "close"}
    )
    return Response(status.value, status.phrase, headers, content)
