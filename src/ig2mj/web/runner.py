"""`Runner`: the thread that simulates. It takes commands, and leaves shots in a mailbox; it never waits for a page."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable, Hashable

import numpy as np

from ig2mj.errors import Ig2mjError
from ig2mj.web.planning import Requests
from ig2mj.web.shots import Mailbox
from ig2mj.web.sources import Source, Timeline
from ig2mj.web.spring import Drag, pull, release

SHOTS_PER_SECOND = 30.0
"""More than a page shows are not made."""
_IDLE = 0.25
"""Seconds after which a paused runner looks for its end."""


class Runner:
    """Steps a source in real time.

    Attributes:
      source: what is stepped. mailbox: its shots. world: the one that is shown. playing: time passes. speed: simulated
      seconds in a second. trouble: why it stopped by itself, or "". steps: taken since the start. slow: how much slower
      than asked the last second was (1: in time).
    """

    def __init__(self, source: Source, playing: bool = True, speed: float = 1.0):
        self.source, self.mailbox = source, Mailbox()
        self.world, self.playing, self.speed, self.trouble, self.steps = 0, playing, speed, "", 0
        self.drags: dict[Hashable, Drag] = {}
        self._commands: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._run, name="ig2mj-physics", daemon=True)

    def start(self) -> None:
        """Begins; the first shot comes at once."""
        self._thread.start()

    def stop(self) -> None:
        """Ends the thread; may be called twice."""
        self._stopped.set()
        self._commands.put(lambda: None)
        if self._thread.is_alive():
            self._thread.join(30)

    # Commands, from any thread.

    def play(self, playing: bool) -> None:
        """Lets time pass, or not."""

        def act() -> None:
            timeline = self.source
            if playing and isinstance(timeline, Timeline) and timeline.frame >= timeline.frames - 1:
                timeline.seek(0)
            self.playing, self.trouble = playing, ""

        self._commands.put(act)

    def step(self) -> None:
        """One step, and a pause."""

        def act() -> None:
            self.playing = False
            self._step()

        self._commands.put(act)

    def reset(self, row: int | None = None) -> None:
        """Puts the world that is shown back to its start, or to a row of the pool."""
        if row is not None and not 0 <= row < max(self.source.rows, 1):
            return

        def act() -> None:
            self._release_all()
            self.source.reset(self.world, row)
            self.trouble = ""
            self._show(jump=True)

        self._commands.put(act)

    def look_at(self, world: int) -> None:
        """Shows another world of the batch."""

        def act() -> None:
            self._release_all()
            self.world = min(max(world, 0), self.source.num_worlds - 1)
            self._show(jump=True)

        self._commands.put(act)

    def seek(self, frame: int, run: int | None = None) -> None:
        """Goes to a frame of a recording."""

        def act() -> None:
            if isinstance(self.source, Timeline):
                self.source.seek(frame, run)
                self._show(jump=True)

        self._commands.put(act)

    def request(self, act: Callable[[Requests], None]) -> None:
        """Asks the robot of a source for something, and lets time pass."""

        def request() -> None:
            if isinstance(self.source, Requests):
                act(self.source)
                self.playing, self.trouble = True, ""

        self._commands.put(request)

    def drag(self, who: Hashable, drag: Drag | None) -> None:
        """Fastens a page's spring, moves its end, or (None) lets go."""

        def act() -> None:
            old = self.drags.pop(who, None)
            found = self.source.mujoco(self.world)
            if found is None:
                return
            if drag is not None and 0 < drag.body < found[0].nbody and np.isfinite([*drag.point, *drag.target]).all():
                if old is not None and old.body == drag.body:
                    drag.mass, drag.point = old.mass, old.point
                elif old is not None:
                    release(found[1], old)
                self.drags[who] = drag
            elif old is not None:
                release(found[1], old)

        self._commands.put(act)

    # The thread.

    def _run(self) -> None:
        self._show(jump=True)
        due = shown = time.monotonic()
        while not self._stopped.is_set():
            self._obey(block=not self.playing)
            now = time.monotonic()
            if not self.playing:
                due = now
                continue
            if now < due:
                self._stopped.wait(min(due - now, 0.05))
                continue
            self._step(show=now - shown >= 0.9 / SHOTS_PER_SECOND or self.source.period > 1.5 / SHOTS_PER_SECOND)
            if now - shown >= 0.9 / SHOTS_PER_SECOND:
                shown = now
            due = max(due + self.source.period / self.speed, now - 0.1)  # never hurry after it was too slow

    def _obey(self, block: bool) -> None:
        try:
            command = self._commands.get(block, _IDLE) if block else self._commands.get_nowait()
            while True:
                self._try(command)
                command = self._commands.get_nowait()
        except queue.Empty:
            pass

    def _step(self, show: bool = True) -> None:
        self._try(self._pull_and_step)
        if show or self.trouble:
            self._show()
        source = self.source
        if isinstance(source, Timeline) and source.frame >= source.frames - 1:
            self.playing = False
            self._show()

    def _pull_and_step(self) -> None:
        found = self.source.mujoco(self.world) if self.drags else None
        if found is not None:
            for drag in self.drags.values():
                pull(*found, drag)
        self.source.step()
        self.steps += 1

    def _release_all(self) -> None:
        found = self.source.mujoco(self.world) if self.drags else None
        if found is not None:
            for drag in self.drags.values():
                release(found[1], drag)
        self.drags.clear()

    def _show(self, jump: bool = False) -> None:
        self._try(lambda: self.mailbox.put(self.source.shot(self.world, jump)))

    def _try(self, act: Callable[[], None]) -> None:
        """What goes wrong pauses the world and is shown; the thread lives on."""
        try:
            act()
        except Exception as e:
            self.playing, text = False, " ".join(str(e).split())
            self.trouble = text if isinstance(e, Ig2mjError) else f"{type(e).__name__}: {text}"
