"""viser behind our gate: with `client_page`, what knows viser's inside, and the reason why its version is pinned.

viser has no notion of who may come in: it opens a port for everyone, takes what a page sends for granted, and a page
may ask it to publish itself on the internet. So its server runs on our socket and behind `Gate`, and of its messages
only those below get through, each with the types and sizes that pages send.
"""

from __future__ import annotations

import contextlib
import io
import math
import threading
import types
from collections.abc import Callable
from typing import Any

import msgspec
import viser
import viser._messages as wire
import viser.infra._infra as infra
import websockets.asyncio.server
import websockets.datastructures
import websockets.exceptions
from websockets.asyncio.server import ServerConnection

from ig2mj.web.access import Access
from ig2mj.web.client_page import client_files
from ig2mj.web.serving import Gate, Pages

VERSION = "1.1.1"
"""Of viser, that this module was written for and tested with."""

LONGEST_TEXT = 1000
"""Characters of a text that a page sends."""

_FROM_PAGES: dict[str, type] = {
    m.__name__: m
    for m in (
        wire.ViewerCameraMessage,
        wire.ScenePointerMessage,
        wire.SceneNodeClickMessage,
        wire.SceneNodeDragMessage,
        wire.GuiUpdateMessage,
        wire.GuiFormSubmitMessage,
        wire.GuiFormDirtyMessage,
    )
}
"""What our pages send. Left out: uploads, images of the page, commands, and what publishes the server by a tunnel."""

_IGNORED = frozenset({"ShareUrlRequest", "ShareUrlDisconnect", "LocalStorageGetItemResponseMessage"})
"""What a page can send although it is not wanted; it is dropped, and the page stays."""

_STARTING = threading.Lock()


def check_message(message: str | bytes, element: Callable[[str], Any] | None = None) -> bool:
    """Whether a page's message gets through to viser. Raises ValueError for what no page of ours sends.

    Args:
      element: the present value of an element of the panel, by uuid; None where there is no such one. A page may give
        it another value of the same kind.
    """
    if not isinstance(message, bytes):
        raise ValueError("text")
    try:
        fields = msgspec.msgpack.decode(message)
        if not isinstance(fields, dict) or not isinstance(fields.get("type"), str):
            raise ValueError("no message")
        kind = fields.pop("type")
        if kind in _IGNORED:
            return False
        if kind not in _FROM_PAGES:
            raise ValueError("no message of a page")
        _check_values(fields)
        if kind == "GuiUpdateMessage":
            updates = fields.get("updates")
            if not isinstance(fields.get("uuid"), str) or not isinstance(updates, dict) or set(updates) - {"value"}:
                raise ValueError("no update")
            if element is not None:
                return _is_like(updates.get("value"), element(fields["uuid"]))
        else:
            msgspec.convert(fields, _FROM_PAGES[kind])
    except (msgspec.MsgspecError, RecursionError, TypeError, OverflowError) as e:
        raise ValueError("malformed") from e
    return True


def _is_like(new: Any, old: Any) -> bool:
    """Whether an element is there. Raises ValueError where the new value is of another kind than the old one."""
    if old is None:
        return False
    numbers = (int, float)
    if isinstance(old, bool) or isinstance(new, bool):
        fits = isinstance(old, bool) and isinstance(new, bool)
    elif isinstance(old, numbers):
        fits = isinstance(new, numbers)
    elif isinstance(old, tuple):
        fits = isinstance(new, list) and len(new) == len(old) and all(map(_is_like, new, old))
    else:
        fits = isinstance(new, type(old))
    if not fits:
        raise ValueError("value")
    return True


def _check_values(value: Any, depth: int = 0) -> None:
    """Finite numbers of sensible size, short texts, few of each."""
    if depth > 4:
        raise ValueError("nested")
    if isinstance(value, dict):
        if len(value) > 32:
            raise ValueError("long")
        for key, inner in value.items():
            if not isinstance(key, str) or len(key) > 64:
                raise ValueError("no name")
            _check_values(inner, depth + 1)
    elif isinstance(value, list):
        if len(value) > 64:
            raise ValueError("long")
        for inner in value:
            _check_values(inner, depth + 1)
    elif isinstance(value, str):
        if len(value) > LONGEST_TEXT:
            raise ValueError("long")
    elif isinstance(value, (int, float)):
        if not math.isfinite(value) or abs(value) > 1e12:
            raise ValueError("number")
    elif value is not None:
        raise ValueError("kind")


def start_viser(access: Access, title: str) -> tuple[viser.ViserServer, Gate]:
    """A running server of viser's on the port of `access`, behind the gate. `stop_viser` ends it.

    Raises:
      Ig2mjError: the port is taken.
    """
    elements: list[Callable[[str], Any]] = []
    gate = Gate(access, lambda message: check_message(message, elements[0] if elements else None))
    files = client_files()
    pages = Pages(files, lasting=[name for name in files if name])
    listening = access.listen()

    class Serve(websockets.asyncio.server.serve):
        """viser's call of websockets' server, on our socket and with the gate's options."""

        def __init__(self, handler: Any, host: str, port: int, **options: Any):
            kept = {"select_subprotocol": options["select_subprotocol"]}
            super().__init__(handler, sock=listening, **kept, **gate.options(pages))

    module: Any = infra
    real = module.websockets
    server = types.SimpleNamespace(serve=Serve, ServerConnection=ServerConnection)
    names = {"exceptions": websockets.exceptions, "datastructures": websockets.datastructures}
    with _STARTING:
        module.websockets = types.SimpleNamespace(asyncio=types.SimpleNamespace(server=server), **names)
        try:
            with contextlib.redirect_stdout(io.StringIO()):  # its banner has an address without a token
                made = viser.ViserServer(access.host, access.port, label=title, verbose=False)
        finally:
            module.websockets = real
    elements.append(lambda uuid: _value_of(made, uuid))
    return made, gate


def _value_of(server: viser.ViserServer, uuid: str) -> Any:
    handle = server.gui._gui_input_handle_from_uuid.get(uuid)
    return None if handle is None else handle._impl.value


def stop_viser(server: viser.ViserServer) -> None:
    """Ends it, without a word on standard output."""
    with contextlib.redirect_stdout(io.StringIO()):
        server.stop()
