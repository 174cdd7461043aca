"""A page without a browser: speaks viser's protocol as its client does, and keeps what it was sent."""

from __future__ import annotations

import time
from typing import Any

import msgspec
import zstandard
from websockets.sync.client import connect

PROTOCOL = "viser-v1.1.1"


class Page:
    """A page of `WebViewer`. A context manager.

    Attributes:
      nodes: names of what is in the scene. positions: last one of each node that was moved. gui: properties of each
      element of the panel, by uuid. messages: how many of each type came. size: bytes that came.
    """

    def __init__(self, port: int, **headers: str):
        self._socket = connect(
            f"ws://127.0.0.1:{port}/",
            subprotocols=[PROTOCOL],  # type: ignore[list-item]
            additional_headers=headers,
            max_size=None,
            open_timeout=20,
        )
        self.nodes: set[str] = set()
        self.positions: dict[str, tuple[float, ...]] = {}
        self.gui: dict[str, dict[str, Any]] = {}
        self.messages: dict[str, int] = {}
        self.size = 0
        self.look_from((3.0, 3.0, 3.0))

    def __enter__(self) -> Page:
        return self

    def __exit__(self, *error: object) -> None:
        self._socket.close()

    def send(self, kind: str, **fields: Any) -> None:
        """A message as the page's program packs it."""
        self._socket.send(msgspec.msgpack.encode({"type": kind, **fields}))

    def send_raw(self, data: bytes | str) -> None:
        self._socket.send(data)

    def look_from(self, position: tuple[float, float, float]) -> None:
        """The first message of a page: where its camera is."""
        camera = {"wxyz": (1.0, 0.0, 0.0, 0.0), "position": position, "fov": 0.8, "near": 0.1, "far": 100.0}
        size = {"image_height": 600, "image_width": 800, "look_at": (0.0, 0.0, 0.0), "up_direction": (0.0, 0.0, 1.0)}
        self.send("ViewerCameraMessage", **camera, **size)

    def set(self, label: str, value: Any) -> None:
        """Changes an element of the panel, or presses it."""
        self.send("GuiUpdateMessage", uuid=self.element(label), updates={"value": value})

    def element(self, label: str) -> str:
        """The uuid of the panel's element with this label."""
        return next(uuid for uuid, props in self.gui.items() if props.get("label") == label)

    def texts(self) -> str:
        """All HTML of the panel."""
        return "\n".join(str(p["content"]) for p in self.gui.values() if p.get("content"))

    def receive(self, until: Any = None, timeout: float = 20.0) -> bool:
        """Takes messages until `until()` is true; says whether it became so in time. None: for `timeout` seconds."""
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            if until is not None and until():
                return True
            try:
                data = self._socket.recv(timeout=max(0.01, min(end - time.monotonic(), 0.5)))
            except TimeoutError:
                continue
            assert isinstance(data, bytes)
            self.size += len(data)
            self._read(data)
        return until is not None and bool(until())

    def _read(self, data: bytes) -> None:
        packed = int.from_bytes(data[8:16], "little")
        plain = zstandard.ZstdDecompressor().decompress(data[16 : 16 + packed])
        for message in msgspec.msgpack.decode(plain)["messages"]:
            kind = message["type"]
            self.messages[kind] = self.messages.get(kind, 0) + 1
            if kind == "SetPositionMessage":
                self.positions[message["name"]] = tuple(message["position"])
            elif kind == "RemoveSceneNodeMessage":
                self.nodes.discard(message["name"])
            elif kind == "GuiUpdateMessage":
                self.gui.setdefault(message["uuid"], {}).update(message["updates"])
            elif kind.startswith("Gui") and "uuid" in message:
                self.gui.setdefault(message["uuid"], {}).update(message.get("props", {}))
            elif "name" in message and "props" in message:
                self.nodes.add(message["name"])
