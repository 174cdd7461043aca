"""`HomePage`: the page of `ig2mj vr`, and what it is told about the home.

Geometry goes once, as a file; poses of bodies that moved go sixty times a second, from a thread that never waits for
physics. The first page that is open drives; others look through its eyes.
"""

from __future__ import annotations

import asyncio
import json
import pathlib
import time
from typing import Any

import numpy as np
from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed

from ig2mj.agents.humanoid.frames import HANDS
from ig2mj.errors import MissingDependencyError
from ig2mj.sensors.tints import TINTS
from ig2mj.vr.frames import Pose
from ig2mj.vr.glb import decorated_glb
from ig2mj.vr.looks import Looks
from ig2mj.vr.messages import LARGEST, Rate, decode, pose_message
from ig2mj.vr.page_source import PagePoses
from ig2mj.vr.session import Session
from ig2mj.vr.xr_axes import hand_from_grip
from ig2mj.web.serving import Access, Pages, PageServer

PAGE = pathlib.Path(__file__).with_name("page")
THREE = "vendor/three.module.js"
"""What `make web` puts next to the page."""

RATE = 60.0
"""Messages with poses a second."""

LOOKS_RATE = 5.0
"""Messages with looks a second, at most."""

MOVED = 1e-5
"""m, and of a quaternion's numbers, from which a body has moved."""


class HomePage:
    """Serves a session to pages; a context manager. Attributes: server, source. rates: frames a second of pages."""

    def __init__(self, session: Session, source: PagePoses, access: Access, timed: bool = False):
        """Binds the port. `timed`: pages show where the time of a frame goes.

        Raises:
          MissingDependencyError: three.js has not been fetched. Ig2mjError: the port is taken.
        """
        check_page()
        self._session, self.source, self._timed = session, source, timed
        scene = session.env.scene
        files = {f.relative_to(PAGE).as_posix(): f.read_bytes() for f in PAGE.rglob("*") if f.is_file()}
        files[""] = files["index.html"]
        files["scene.glb"] = decorated_glb(scene)
        self._welcome = json.dumps(_welcome(session))
        self._pages: list[ServerConnection] = []
        self.rates: dict[ServerConnection, Rate] = {}
        self.server = PageServer(access, Pages(files), self._talk, _is_message, LARGEST)

    @property
    def rate(self) -> Rate | None:
        """Of the page that drives."""
        return next(iter(self.rates.values()), None)

    def __enter__(self) -> HomePage:
        self.server.start()
        return self

    def __exit__(self, *error: object) -> None:
        self.server.stop()

    async def _talk(self, connection: ServerConnection) -> None:
        """One page, until it goes."""
        self._pages.append(connection)
        telling = asyncio.create_task(self._tell(connection))
        try:
            if self._pages[0] is connection:
                self._drive(connection)
            async for message in connection:
                heard = decode(message)
                if isinstance(heard, Rate):
                    self.rates[connection] = heard
                elif self._pages[0] is connection:
                    self.source.receive(heard)
        except ConnectionClosed:
            pass
        finally:
            telling.cancel()
            first = self._pages[0] is connection
            self._pages.remove(connection)
            self.rates.pop(connection, None)
            if first:
                self.source.leave()
                if self._pages:
                    self._drive(self._pages[0])

    def _drive(self, connection: ServerConnection) -> None:
        """This page's person drives from now on."""
        loop = asyncio.get_running_loop()

        def pulse(hand: int, strength: float, seconds: float) -> None:
            text = json.dumps({"type": "pulse", "hand": hand, "strength": strength, "ms": round(seconds * 1000)})
            asyncio.run_coroutine_threadsafe(_send(connection, text), loop)

        self.source.arrive(pulse)

    async def _tell(self, connection: ServerConnection) -> None:
        """Sends what there is to draw, for as long as the page is there."""
        await _send(connection, self._welcome)
        sent: np.ndarray | None = None
        looks: Looks | None = None
        due, looks_due = time.monotonic(), 0.0
        while True:
            now = time.monotonic()
            poses = self._session.track.at(now)
            if poses is not None:
                index = np.arange(len(poses)) if sent is None else np.flatnonzero(np.abs(poses - sent).max(1) > MOVED)
                frame = self.source.poll()
                head = frame.head if frame is not None else None
                message = pose_message(self.source.area, head, index, poses[index])
                sent = poses.copy() if sent is None else sent
                sent[index] = poses[index]
                await _send(connection, message)
            if self._session.looks is not looks and now >= looks_due:
                looks, looks_due = self._session.looks, now + 1.0 / LOOKS_RATE
                await _send(connection, json.dumps(_looks(looks, self._session, self._timed)))
            due = max(due + 1.0 / RATE, time.monotonic())
            await asyncio.sleep(due - time.monotonic())


def check_page() -> None:
    """Raises MissingDependencyError, with what to do, where the page's library is not there."""
    if not (PAGE / THREE).is_file():
        raise MissingDependencyError(
            "three.js for the page is not there; `make web` in a checkout fetches it (it needs npm), and wheels have it"
        )


def _welcome(session: Session) -> dict[str, Any]:
    """What a page must know once."""
    env = session.env
    model, tables = env.scene.model, env.scene.tables
    hands = []
    for k, name in enumerate(HANDS):
        palm = int(tables.hand_body[k])
        inside = hand_from_grip(k, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
        hands.append(
            {
                "name": name,
                "palm": palm,
                "bodies": np.flatnonzero(model.body_rootid == model.body_rootid[palm]).tolist(),
                "in_grip": _row(inside),
            }
        )
    tints = [{"weight": t.weight, "colour": t.colour, "brightness": t.brightness} for t in TINTS]
    return {
        "type": "welcome",
        "task": env.task.name,
        "summary": env.task.summary,
        "bodies": int(model.nbody),
        "own": int(tables.agent_body[0]),
        "hands": hands,
        "tints": tints,
    }


def _looks(looks: Looks, session: Session, timed: bool) -> dict[str, Any]:
    return {
        "type": "looks",
        "marks": np.round(looks.marks, 5).tolist(),
        "tint": looks.tint.tolist(),
        "goal": looks.goal,
        "holds": looks.holds,
        "seconds": round(looks.seconds, 2),
        "attached": session.memory.attached,
        "timing": {name: round(value, 2) for name, value in session.timing.summary().items()} if timed else {},
    }


def _is_message(message: str | bytes) -> bool:
    """True; raises ValueError for what no page sends."""
    decode(message)
    return True


def _row(pose: Pose) -> list[float]:
    return [*pose.pos.tolist(), *pose.quat.tolist()]


async def _send(connection: ServerConnection, message: str | bytes) -> None:
    try:
        await connection.send(message)
    except ConnectionClosed:
        raise asyncio.CancelledError from None
