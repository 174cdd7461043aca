"""A gate before pages and web sockets, and a small server of both in a thread of its own.

    access = access_for(host, port, token, certificate, key)
    server = PageServer(access, Pages(files), talk)
    server.start()
    print(server.url)

`talk(connection)` is a coroutine that runs as long as a page's web socket is open; `async for message in connection`
gives what the page sends. The gate stands before everything: who has no token gets a form and nothing else; requests
of other sites' pages are refused; what is too large, malformed or too much ends the connection that it came by, and
nothing else. Nothing of that reaches the thread that simulates.
"""

from __future__ import annotations

import asyncio
import gzip
import hmac
import http
import logging
import mimetypes
import pathlib
import re
import secrets
import threading
import time
import urllib.parse
from collections.abc import Awaitable, Callable, Collection, Mapping
from http.cookies import CookieError, SimpleCookie
from typing import Any

from websockets.asyncio.server import ServerConnection, serve
from websockets.datastructures import Headers, MultipleValuesError
from websockets.http11 import Request, Response

from ig2mj.web.access import Access, access_for, is_loopback

__all__ = ["Access", "Gate", "GuardedConnection", "PageServer", "Pages", "access_for"]

LARGEST_MESSAGE = 64 * 1024
"""Bytes of a message from a page. What pages send are clicks and numbers."""
MESSAGES_PER_SECOND, BURST = 400.0, 800.0
"""What one page may send in the long run, and at once. A page that follows a mouse sends 60 a second."""
MOST_PAGES = 32
"""Web sockets at a time."""

Talk = Callable[[ServerConnection], Awaitable[None]]
Check = Callable[[str | bytes], bool]
"""Whether a message is wanted; raises ValueError for one that no page of ours sends."""

_HOST = re.compile(
    r"(?:\[(?P<address>[0-9A-Fa-f:.]{1,45})\]|(?P<name>[0-9A-Za-z._-]{1,253}))(?::(?P<port>\d{1,5}))?", re.ASCII
)

_SILENT = logging.getLogger("ig2mj.web.websockets")
_SILENT.addHandler(logging.NullHandler())
_SILENT.propagate = False  # broken requests of others are not logged

_POLICY = (
    "default-src 'self' data: blob: 'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval'; "
    "connect-src 'self' ws: wss: data: blob:; frame-ancestors 'none'; form-action 'self'; object-src 'none'"
)
"""Nothing is loaded from other hosts."""
_HEADERS = {
    "Content-Security-Policy": _POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}

_FORM = """<!doctype html><html lang="en"><head><meta charset="utf-8"><title>ig2mj</title>
<meta name="viewport" content="width=device-width, initial-scale=1"><style>
body{font:16px system-ui,sans-serif;display:grid;place-items:center;height:95vh;margin:0;background:#f4f4f2;color:#222}
form{background:#fff;padding:2em;border-radius:8px;box-shadow:0 1px 6px #0002;display:grid;gap:.8em;width:20em}
h1{font-size:1.2em;margin:0}p{margin:0;color:#555;font-size:.9em}input,button{font:inherit;padding:.5em}
.no{color:#b00020}</style></head><body><form method="get" action="/"><h1>ig2mj</h1>
<p%s</p><input type="password" name="token" aria-label="token" autofocus
 autocomplete="current-password"><button>Open</button></form></body></html>"""
_ASK = ">This page asks for the token that <code>ig2mj</code> printed when it started."
_WRONG = ' class="no">That is not the token that <code>ig2mj</code> printed when it started.'


class Gate:
    """Lets requests in, or answers them instead.

    Attributes: access: its rules. refused: how many requests and messages were turned away.
    """

    def __init__(self, access: Access, check: Check | None = None, largest: int = LARGEST_MESSAGE):
        """`check`: looks at every message, see `Check`; `largest`: bytes of a message."""
        self.access, self.check, self.largest, self.refused = access, check, largest, 0
        self._cookie, self._session = "ig2mj", secrets.token_urlsafe(32)

    def admit(self, connection: ServerConnection, request: Request) -> Response | None:
        """None: it may go on. Otherwise what the caller gets instead of what it asked for."""
        try:
            answer = self._admit(connection, request)
        except (MultipleValuesError, CookieError, ValueError):
            answer = bad_request()
        if answer is not None and answer.status_code != http.HTTPStatus.SEE_OTHER:
            self.refused += 1
        return answer

    def _admit(self, connection: ServerConnection, request: Request) -> Response | None:
        host = request.headers.get("Host", "")
        if self.access.token is None and not is_loopback(host_name(host)):
            # A site whose name was made to point here (DNS rebinding) is not a page of ours.
            return page(http.HTTPStatus.FORBIDDEN, b"this server is for this machine alone", "text/plain")
        socket = request.headers.get("Upgrade", "").lower() == "websocket"
        origin = request.headers.get("Origin")
        if socket and origin is not None and urllib.parse.urlsplit(origin).netloc.lower() != host.lower():
            return page(http.HTTPStatus.FORBIDDEN, b"another site's page", "text/plain")
        if self.access.token is not None and not self._has_session(request):
            return self._ask(request, socket)
        if socket and len(connection.server.connections) >= MOST_PAGES:
            return page(http.HTTPStatus.SERVICE_UNAVAILABLE, b"too many pages are open", "text/plain")
        return None

    def _has_session(self, request: Request) -> bool:
        found = SimpleCookie(request.headers.get("Cookie", "")).get(self._name(request))
        return found is not None and hmac.compare_digest(found.value.encode(), self._session.encode())

    def _name(self, request: Request) -> str:
        """Cookies are shared by all ports of a host."""
        return f"{self._cookie}_{host_port(request.headers.get('Host', ''))}"

    def _ask(self, request: Request, socket: bool) -> Response:
        parts = urllib.parse.urlsplit(request.path)
        given = urllib.parse.parse_qs(parts.query).get("token", [])
        if socket or not given:
            return page(http.HTTPStatus.UNAUTHORIZED, (_FORM % _ASK).encode())
        assert self.access.token is not None
        if not hmac.compare_digest(given[0].encode(), self.access.token.encode()):
            return page(http.HTTPStatus.UNAUTHORIZED, (_FORM % _WRONG).encode())
        # The token leaves the address bar and the history; a secret of this run takes its place.
        answer = page(http.HTTPStatus.SEE_OTHER, b"", "text/plain")
        answer.headers["Location"] = "/" + parts.path.lstrip("/\\")
        secure = "; Secure" if self.access.tls is not None else ""
        answer.headers["Set-Cookie"] = f"{self._name(request)}={self._session}; Path=/; HttpOnly; SameSite=Lax{secure}"
        return answer

    def options(self, answer: Callable[[ServerConnection, Request], Response | None]) -> dict[str, Any]:
        """Arguments of `websockets.asyncio.server.serve`, apart from the socket.

        Args:
          answer: gives the page of a request that was let in; None for a web socket.
        """
        gate = self

        class Connection(GuardedConnection):
            def __init__(self, *args: Any, **kwargs: Any):
                super().__init__(*args, **kwargs)
                self.gate = gate

        def process(connection: ServerConnection, request: Request) -> Response | None:
            refusal = gate.admit(connection, request)
            if refusal is not None:
                return refusal
            try:
                return answer(connection, request)
            except (MultipleValuesError, ValueError):
                gate.refused += 1
                return bad_request()

        return {
            "process_request": process,
            "create_connection": Connection,
            "max_size": self.largest,
            "compression": None,
            "logger": _SILENT,
            "server_header": None,
            "open_timeout": 10,
            "ping_interval": 20,
            "ping_timeout": 30,
            "close_timeout": 2,
            "ssl": self.access.tls,
        }


class GuardedConnection(ServerConnection):
    """A web socket that ends itself when its page sends what no page sends, or too much of it."""

    gate: Gate
    _allowance, _since = BURST, 0.0

    async def recv(self, decode: bool | None = None) -> Any:
        """As of `websockets`. Raises ConnectionClosed, also for messages that are turned away."""
        while True:
            message = await super().recv(decode)
            now = time.monotonic()
            self._allowance = min(BURST, self._allowance + (now - self._since) * MESSAGES_PER_SECOND) - 1
            self._since = now
            reason = "too many messages" if self._allowance < 0 else ""
            requested = True
            if not reason and self.gate.check is not None:
                try:
                    requested = self.gate.check(message)
                except ValueError:
                    reason = "malformed message"
            if reason:
                self.gate.refused += 1
                await self.close(1008, reason)
                await self.wait_closed()
                raise self.protocol.close_exc
            if requested:
                return message


class Pages:
    """Files to serve, all read beforehand: no path of a request ever becomes a path of this machine."""

    def __init__(
        self, files: Mapping[str, bytes], kinds: Mapping[str, str] | None = None, lasting: Collection[str] = ()
    ):
        """Args:
        files: by path without the first slash, "" being the first page.
        kinds: content types.
        lasting: files whose names change with their content: browsers may keep them, and they are packed at once.
        """
        kinds, self._lasting = kinds or {}, frozenset(lasting)
        self._plain = {name: body for name, body in files.items()}
        self._kinds = {name: kinds.get(name) or content_type(name or "index.html") for name in files}
        self._packed = {name: _pack(files[name]) for name in self._lasting}

    def __call__(self, connection: ServerConnection, request: Request) -> Response | None:
        """The page that is asked for, or status 404; None for a web socket."""
        if request.headers.get("Upgrade", "").lower() == "websocket":
            return None
        name = urllib.parse.unquote(urllib.parse.urlsplit(request.path).path).lstrip("/")
        if name not in self._plain:
            return page(http.HTTPStatus.NOT_FOUND, b"there is no such page", "text/plain")
        body, kind = self._plain[name], self._kinds[name]
        if "gzip" in request.headers.get("Accept-Encoding", ""):
            if name not in self._packed:
                self._packed[name] = _pack(body)
            answer = page(http.HTTPStatus.OK, self._packed[name], kind)
            answer.headers["Content-Encoding"] = "gzip"
        else:
            answer = page(http.HTTPStatus.OK, body, kind)
        if name in self._lasting:
            del answer.headers["Cache-Control"]
            answer.headers["Cache-Control"] = "private, max-age=31536000, immutable"
        return answer


def _pack(body: bytes) -> bytes:
    return gzip.compress(body, 6, mtime=0)


def content_type(name: str) -> str:
    """Of a file, by its ending; not the machine's own table, which some programs change."""
    known = {".js": "text/javascript", ".mjs": "text/javascript", ".wasm": "application/wasm"}
    known |= {".glb": "model/gltf-binary", ".html": "text/html; charset=utf-8", ".css": "text/css; charset=utf-8"}
    ending = pathlib.PurePosixPath(name).suffix.lower()
    return known.get(ending) or mimetypes.guess_type(name)[0] or "application/octet-stream"


def host_name(host: str) -> str:
    """The name or address in a Host header, without brackets; "" where it is no such header (a user before an "@")."""
    match = _HOST.fullmatch(host)
    return (match["address"] or match["name"]) if match else ""


def host_port(host: str) -> int:
    """The port in a Host header; 0 where it has none. Raises ValueError: it is no such header."""
    match = _HOST.fullmatch(host)
    if match is None:
        raise ValueError("Host")
    return int(match["port"] or 0)


def bad_request() -> Response:
    """The answer to what no browser sends."""
    return page(http.HTTPStatus.BAD_REQUEST, b"bad request", "text/plain")


def page(status: http.HTTPStatus, body: bytes, kind: str = "text/html; charset=utf-8") -> Response:
    """An answer with the headers that every page has."""
    headers = Headers({**_HEADERS, "Content-Type": kind, "Content-Length": str(len(body)), "Connection": "close"})
    return Response(int(status), status.phrase, headers, body)


class PageServer:
    """Pages and web sockets behind a gate, in a thread of its own. A context manager. Attributes: gate, port."""

    def __init__(self, access: Access, pages: Pages, talk: Talk, check: Check | None = None, largest: int = 0):
        """Binds the port; nothing is answered before `start`.

        Args:
          talk: serves one web socket until it is closed; what it raises ends that web socket.
          check, largest: as of `Gate`.

        Raises:
          Ig2mjError: the port is taken.
        """
        self.gate = Gate(access, check, largest or LARGEST_MESSAGE)
        self._pages, self._talk, self._socket = pages, talk, access.listen()
        self.port = int(self._socket.getsockname()[1])
        self._loop: asyncio.AbstractEventLoop | None = None
        self._stop: asyncio.Event | None = None
        self._ready = threading.Event()
        self._thread = threading.Thread(target=self._run, name="ig2mj-pages", daemon=True)

    @property
    def url(self) -> str:
        """Address of the first page, with the token where there is one."""
        return self.gate.access.url(self.port, token=True)

    @property
    def loop(self) -> asyncio.AbstractEventLoop:
        """In which `talk` runs; use `call_soon_threadsafe`."""
        assert self._loop is not None, "start first"
        return self._loop

    def start(self) -> None:
        """Begins to answer; returns when it does."""
        self._thread.start()
        self._ready.wait()

    def stop(self) -> None:
        """Closes all web sockets and the port; may be called twice."""
        if self._thread.is_alive() and self._loop is not None and self._stop is not None:
            self._loop.call_soon_threadsafe(self._stop.set)
            self._thread.join(10)
        self._socket.close()

    def __enter__(self) -> PageServer:
        self.start()
        return self

    def __exit__(self, *error: object) -> None:
        self.stop()

    def _run(self) -> None:
        asyncio.run(self._serve())

    async def _serve(self) -> None:
        self._loop, self._stop = asyncio.get_running_loop(), asyncio.Event()
        async with serve(self._talk, sock=self._socket, **self.gate.options(self._pages)):
            self._ready.set()
            await self._stop.wait()
