"""The panel next to the view: play, pause, step, reset, rows, worlds, time line, colours; object and goal.

Callbacks run in viser's thread: they leave a command for the thread that simulates, and return.
"""

from __future__ import annotations

import math
import time
from typing import Any

import viser

from ig2mj.web.looks import COLOURS
from ig2mj.web.planning import Requests
from ig2mj.web.runner import Runner
from ig2mj.web.sources import Timeline
from ig2mj.web.tables import goal_tree, object_table, plan_table, status

NOTHING = "(click an object, or choose one)"
READY = "<div style='padding:0 12px 8px;font-size:12.5px;color:#6b7280'>getting ready ...</div>"
"""In the place of what is not compiled yet."""
SPEEDS = {"1/10": 0.1, "1/4": 0.25, "1/2": 0.5, "1": 1.0, "2": 2.0, "4": 4.0, "10": 10.0}


class Controls:
    """The panel. Attributes: chosen: index of the object whose states are listed, or -1. colours: see `COLOURS`."""

    def __init__(self, server: viser.ViserServer, runner: Runner, title: str):
        """Makes the panel."""
        self._server, self._runner, self._source = server, runner, runner.source
        self.chosen, self.colours = -1, COLOURS[0]
        self.names_shown = self.rooms_shown = False
        self._texts: dict[int, str] = {}
        self._offered: dict[str, tuple[str, ...]] = {}
        self._buttons: list[Any] = []
        self._marked = (time.monotonic(), runner.steps)
        self._rate = 0.0
        gui = server.gui
        gui.configure_theme(
            control_width="medium",
            show_logo=False,
            show_share_button=False,
            brand_color=(44, 95, 138),
        )
        gui.main_panel.dock_right()
        gui.set_panel_label(title)
        with gui.add_folder("Run"):
            self._run()
        if isinstance(self._source, Timeline):
            with gui.add_folder("Recording"):
                self._recording(self._source)
        if self._source.num_worlds > 1 or self._source.rows:
            with gui.add_folder("Worlds"):
                self._worlds()
        self._plan: Any = None
        if isinstance(self._source, Requests):
            with gui.add_folder("Robot"):
                self._robot(self._source)
        self._goal: Any = None
        if self._source.goal is not None:
            with gui.add_folder("Goal"):
                self._goal = gui.add_html(READY)
        self._object_folder = gui.add_folder("Object")
        with self._object_folder:
            self._object()
        with gui.add_folder("View", expand_by_default=False):
            self._view()

    def _run(self) -> None:
        gui, runner = self._server.gui, self._runner
        self._status = gui.add_html("")
        buttons = gui.add_button_group("Time", ("Play", "Pause", "Step", "Reset"))
        speed = gui.add_dropdown("Speed", tuple(SPEEDS), initial_value="1")
        acts = {
            "Play": lambda: runner.play(True),
            "Pause": lambda: runner.play(False),
            "Step": runner.step,
            "Reset": runner.reset,
        }

        @buttons.on_click
        async def _(_: Any) -> None:
            if buttons.value in acts:
                acts[buttons.value]()

        @speed.on_update
        async def _(event: Any) -> None:
            if speed.value in SPEEDS:
                runner.speed = SPEEDS[speed.value]

    def _robot(self, source: Requests) -> None:
        gui, runner = self._server.gui, self._runner
        self._plan = gui.add_html("")
        solvable = self._source.goal is not None
        buttons = gui.add_button_group("Plan", ("Solve", "Stop") if solvable else ("Stop",))

        @buttons.on_click
        async def _(_: Any) -> None:
            if buttons.value == "Solve":
                runner.request(lambda requests: requests.solve())
            elif buttons.value == "Stop":
                runner.request(lambda requests: requests.stop())

    def _offer(self, source: Requests) -> None:
        """Buttons for what the robot can do with the chosen object."""
        name = self._source.scene.object_names[self.chosen] if self.chosen >= 0 else ""
        offered = source.offered(name) if name else {}
        if offered == self._offered:
            return
        for button in self._buttons:
            button.remove()
        self._offered, self._buttons = offered, []
        with self._object_folder:
            for text, words in offered.items():
                self._buttons.append(self._button(text, words))

    def _button(self, text: str, words: tuple[str, ...]) -> Any:
        button, runner = self._server.gui.add_button(text, order=self._states.order - 0.5), self._runner

        @button.on_click
        async def _(_: Any) -> None:
            runner.request(lambda requests: requests.ask(words))

        return button

    def _recording(self, timeline: Timeline) -> None:
        gui, runner = self._server.gui, self._runner
        names = tuple(timeline.runs)
        if len(names) > 1:
            run = gui.add_dropdown("Run", names, initial_value=names[timeline.run])

            @run.on_update
            async def _(event: Any) -> None:
                if event.client is not None and run.value in names:
                    runner.seek(0, names.index(run.value))

        self._line_seen = timeline.frame
        self._line = gui.add_slider("Frame", 0, max(timeline.frames - 1, 1), 1, timeline.frame)

        @self._line.on_update
        async def _(event: Any) -> None:
            if event.client is not None and _whole(self._line.value):
                runner.play(False)
                runner.seek(int(self._line.value))

    def _worlds(self) -> None:
        gui, runner, source = self._server.gui, self._runner, self._source
        if source.num_worlds > 1:
            world = gui.add_number("World", 0, min=0, max=source.num_worlds - 1, step=1)

            @world.on_update
            async def _(event: Any) -> None:
                if event.client is not None and _whole(world.value):
                    runner.look_at(int(world.value))

        if source.rows:
            row = gui.add_number("Pool row", 0, min=0, max=source.rows - 1, step=1)
            load = gui.add_button("Start from this row", icon=viser.Icon.TABLE_ROW)

            @load.on_click
            async def _(_: Any) -> None:
                if _whole(row.value):
                    runner.reset(int(row.value))

    def _view(self) -> None:
        gui = self._server.gui
        colours = gui.add_dropdown("Colours", COLOURS, initial_value=self.colours)
        names, rooms = gui.add_checkbox("Names of objects", False), gui.add_checkbox("Names of rooms", False)

        @colours.on_update
        async def _(_: Any) -> None:
            if colours.value in COLOURS:
                self.colours = colours.value

        @names.on_update
        async def _(_: Any) -> None:
            self.names_shown = bool(names.value)

        @rooms.on_update
        async def _(_: Any) -> None:
            self.rooms_shown = bool(rooms.value)

    def _object(self) -> None:
        gui, names = self._server.gui, self._source.scene.object_names
        self._picker = gui.add_dropdown("Object", (NOTHING, *sorted(names)), initial_value=NOTHING)
        self._states = gui.add_html("")
        index = {name: k for k, name in enumerate(names)}

        @self._picker.on_update
        async def _(_: Any) -> None:
            self.chosen = index.get(self._picker.value, -1)

    def choose(self, index: int) -> None:
        """Lists the states of an object that was clicked."""
        self._picker.value = self._source.scene.object_names[index]  # its callback does the rest
        self.chosen = index

    # What is written, in the thread that shows.

    def write(self, shot: Any, shown: int) -> None:
        """Brings texts up to date. `shown`: poses that were sent with the last shot."""
        runner, model = self._runner, self._source.model
        now, steps = time.monotonic(), runner.steps
        if now - self._marked[0] >= 1.0:
            self._rate = (steps - self._marked[1]) / (now - self._marked[0]) * self._source.period
            self._marked = (now, steps)
        rows = [("time", f"{shot.time:.1f} s"), *shot.facts]
        speed = f"{self._rate:.2g} x real time" if steps else "getting ready"  # the first step compiles
        rows.append(("speed", speed if runner.playing else "paused"))
        rows.append(("bodies that moved", str(shown)))
        self._set(self._status, status(rows, runner.trouble))
        if isinstance(self._source, Timeline):
            self._follow(self._source)
        if self.chosen >= 0 and not self._states.content:
            self._states.content = READY
        self._set(self._states, object_table(model, shot, self.chosen) if self.chosen >= 0 else "")
        if isinstance(self._source, Requests):
            self._set(self._plan, plan_table(self._source.report))
            self._offer(self._source)
        if self._goal is not None and self._source.goal is not None:
            self._set(self._goal, goal_tree(self._source.goal, shot))

    def _follow(self, timeline: Timeline) -> None:
        last = max(timeline.frames - 1, 1)
        if self._line.max != last:
            self._line.max = last
        shown, self._line_seen = self._line_seen, self._line.value
        if self._line.value != timeline.frame and (self._runner.playing or self._line.value == shown):
            self._line.value = self._line_seen = min(timeline.frame, last)  # nobody moves it just now

    def _set(self, handle: Any, text: str) -> None:
        """Sends a text only where it changed."""
        if self._texts.get(id(handle)) != text:
            self._texts[id(handle)] = text
            handle.content = text


def _whole(value: Any) -> bool:
    return isinstance(value, (int, float)) and math.isfinite(value)
