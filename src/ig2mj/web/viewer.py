"""`WebViewer`: a source in the browser, by three threads.

    with WebViewer(Home(scene, core), access_for()) as viewer:
        print(viewer.url)
        viewer.wait()

One simulates and leaves shots in a mailbox (`Runner`), one turns shots into what changed for the pages, and viser's own
talks to the pages. None waits for the next one: a shot that is late is left out, and of a node that changed twice
before a page could take it, viser sends only the newest state.
"""

from __future__ import annotations

import threading
import time
from typing import Any

import numpy as np
from jaxtyping import Int

from ig2mj.sensors.tints import SWITCHED_ON
from ig2mj.viewer.state_effects import effects
from ig2mj.viewer.state_marks import Mark, tint_of_objects
from ig2mj.web.access import Access
from ig2mj.web.controls import Controls
from ig2mj.web.looks import drops_of, looks_of, patches_of
from ig2mj.web.runner import SHOTS_PER_SECOND, Runner
from ig2mj.web.shots import Shot, between
from ig2mj.web.sources import Source
from ig2mj.web.spring import Drag
from ig2mj.web.stage import Stage
from ig2mj.web.viser_server import start_viser, stop_viser

TABLES_PER_SECOND = 4.0
"""How often texts, colours and particles are looked through."""


class WebViewer:
    """A source in the browser. Attributes: runner, stage, controls, gate: its parts. frames: frames sent so far."""

    def __init__(
        self, source: Source, access: Access, *, playing: bool = True, title: str = "", looks: str | None = None
    ):
        """Opens the port and sends the home; nothing moves before `start`.

        Args:
          looks: how the home is shown: one of `ig2mj.scene.scene.LOOKS`; None: the scene's own.

        Raises:
          Ig2mjError: the port is taken.
        """
        self.runner = Runner(source, playing)
        self._server, self.gate = start_viser(access, title or source.scene.name)
        movable = self._drag if source.mujoco(0) is not None else None
        self.stage = Stage(self._server, source.scene, self._click, movable, looks)
        self.controls = Controls(self._server, self.runner, title or source.scene.name)
        self.frames = 0
        self._last: Shot | None = None
        self._tint: Int[np.ndarray, "O"] | None = None
        self._effects = False
        self._moved = 0
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._run, name="ig2mj-shows", daemon=True)
        self._server.on_client_disconnect(self._left)

    @property
    def port(self) -> int:
        """That pages come to."""
        return int(self._server.get_port())

    @property
    def url(self) -> str:
        """Address of the page, with the token where there is one."""
        return self.gate.access.url(self.port, token=True)

    @property
    def pages(self) -> int:
        """How many are open."""
        return len(self._server.get_clients())

    def start(self) -> None:
        """Lets time pass, and shows it."""
        self.runner.start()
        self._thread.start()

    def stop(self) -> None:
        """Closes all pages and the port; may be called twice."""
        self.runner.stop()
        self._stopped.set()
        if self._thread.is_alive():
            self._thread.join(10)
        stop_viser(self._server)

    def wait(self) -> None:
        """Until someone interrupts."""
        while not self._stopped.wait(1.0):
            pass

    def __enter__(self) -> WebViewer:
        self.start()
        return self

    def __exit__(self, *error: object) -> None:
        self.stop()

    # Pages' wishes, in viser's thread.

    def _click(self, index: int) -> None:
        self.controls.choose(index)

    def _drag(self, event: Any, body: int, node: Any) -> None:
        if event.phase == "end":
            self.runner.drag(event.client_id, None)
            return
        start, end = np.array(event.start_position, float), np.array(event.end_position, float)
        shot = self._last
        if shot is None or not np.isfinite([start, end]).all():
            return
        turn = _matrix(shot.body_quat[body])
        self.runner.drag(event.client_id, Drag(body, turn.T @ (start - shot.body_pos[body]), end))

    async def _left(self, client: Any) -> None:
        self.runner.drag(client.client_id, None)

    # The thread that shows.

    def _run(self) -> None:
        looked = 0.0
        while not self._stopped.is_set():
            shot = self.runner.mailbox.get(1 / TABLES_PER_SECOND)
            if shot is not None:
                self._show(shot)
            now = time.monotonic()
            if now - looked >= 1 / TABLES_PER_SECOND and self._last is not None:
                self._look(self._last)
                looked = now

    def _show(self, shot: Shot) -> None:
        """Poses at once; for steps longer than a frame, also the poses between."""
        before, count = self._last, 1
        if before is not None and not shot.jump and shot.period > 1.5 / SHOTS_PER_SECOND and self.runner.playing:
            count = min(round(shot.period * SHOTS_PER_SECOND / self.runner.speed), 10)
        if before is not None and count > 1 and before.body_pos.shape == shot.body_pos.shape:
            began = time.monotonic()
            for k in range(1, count):
                self._moved = self.stage.move(*between(before, shot, k / count))
                self.frames += 1
                self._stopped.wait(max(0.0, began + k / SHOTS_PER_SECOND - time.monotonic()))
        self._moved = self.stage.move(shot.body_pos, shot.body_quat)
        self.frames += 1
        self._last = shot
        self.stage.rain(drops_of(shot.states, shot.row))
        if self._effects:
            self._show_effects(shot)
        self._springs(shot)

    def _springs(self, shot: Shot) -> None:
        ends = []
        for drag in list(self.runner.drags.values()):
            at = shot.body_pos[drag.body] + _matrix(shot.body_quat[drag.body]) @ drag.point
            ends.append([at, drag.target])
        self.stage.spring(np.array(ends, float).reshape(-1, 2, 3))

    def _show_effects(self, shot: Shot) -> None:
        """Steam, smoke, frost, drops and glow, with the tints of the last look."""
        found = list[Mark]()
        if self.controls.colours == "states" and self._tint is not None:
            world = self.runner.source.model, shot.states, shot.view, shot.row
            found = effects(*world, time=shot.time, tint=self._tint)
        self.stage.mark(found)
        self._effects = bool(found)

    def _look(self, shot: Shot) -> None:
        """What changes seldom: texts, colours, particles."""
        model = self.runner.source.model
        self.stage.colour(looks_of(model, shot.states, shot.row, self.controls.colours))
        self.stage.dirty(patches_of(model, shot.states, shot.row))
        self._tint = tint_of_objects(model, shot.states, shot.row)
        self._show_effects(shot)
        self.stage.switch(set(np.flatnonzero(self._tint == SWITCHED_ON).tolist()))
        self.stage.write_names(self.controls.names_shown)
        self.stage.write_rooms(self.controls.rooms_shown)
        self.controls.write(shot, self._moved)


def _matrix(quat: np.ndarray) -> np.ndarray:
    """Rotation matrix of a unit quaternion."""
    w, x, y, z = (float(v) for v in quat)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
