"""`Simulation.record` and `Simulation.replay`: every control step of one world, to be replayed bit for bit.

    with simulation.record("run.h5"):
        simulation.robots.act(right_hand_x=0.1)
    other.replay("run.h5")                    # in a fresh process, too

The input of a control step is MuJoCo's controls and what the robots' controllers remember; both are in the frame after
it. What changes a world between steps (a pose that is set, a reset) begins a new run. Forces that are written into
`simulation.data` are not recorded.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import jax
import numpy as np

from ig2mj.demos.frames import Labels, first_difference, names_of, plugin_columns
from ig2mj.demos.origin import LOOSE, differences, missing_objects, origin_of_machine, origin_of_scene, origin_of_states
from ig2mj.demos.reader import Recording, Run
from ig2mj.demos.replay import Replayed
from ig2mj.demos.writer import FLUSH, FORMAT_VERSION, RunWriter
from ig2mj.engine.base import Physics
from ig2mj.errors import EngineError, InputError
from ig2mj.simulation.saving import SavedWorld, put_world
from ig2mj.worlds.hands import Held

if TYPE_CHECKING:
    from ig2mj.simulation.simulation import Simulation

KIND = "simulation"

BINDING = ("mujoco", "scene_hash", "model_hash", "engine", "substeps", "timestep", "grasping", "acting_states")


class SimulationRecorder:
    """Writes the frames of a simulation. Attributes: writer: of the file."""

    def __init__(self, simulation: Simulation, file: str | os.PathLike):
        """See `Simulation.record`."""
        if simulation._recorder is not None:
            raise EngineError("this simulation is being recorded; close that recording first")
        self._simulation, self._engine = simulation, simulation.engine
        names, cuts = _names(simulation), simulation.engine.frame_cuts
        own, batched = dict(zip(names, cuts, strict=False)), names[len(cuts) :]
        self.writer = RunWriter(file, _origin(simulation), own, batched, [])
        # Controllers are input: robots set theirs before they step.
        self._compared = [k for k, name in enumerate(batched) if not name.startswith("controllers/")]
        self._last: list[Any] | None = None
        simulation._recorder = self

    def begin(self) -> None:
        """To be called before steps: where the world is another than after the last one, a new run begins."""
        simulation = self._simulation
        world = simulation._batch.world
        frame = self._frame(simulation.physics, world.states, int(world.step[0]), simulation._batch.grasps)
        if self._last is None or not all(map(_same, self._flat(self._last), self._flat(frame))):
            self.writer.begin({0: {}}, frame[0], frame[1])
            self._last = frame

    def add(self, physics: Physics, states: Any, steps: int, held: Held) -> None:
        """The frame after a control step, which is the `steps`-th."""
        self._last = self._frame(physics, states, steps, held)
        self.writer.add(self._last[0], self._last[1], [])

    def close(self) -> None:
        """Ends the recording; may be called twice."""
        self.writer.close()
        if self._simulation._recorder is self:
            self._simulation._recorder = None

    def __enter__(self) -> SimulationRecorder:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _flat(self, frame: list[Any]) -> list[Any]:
        return [*(piece for own in frame[0] for piece in own), *(frame[1][k] for k in self._compared)]

    def _frame(self, physics: Physics, states: Any, steps: int, held: Held) -> list[Any]:
        own, batched = self._engine.frame(physics, [0])
        return [own, [*batched, *self._engine.kept(jax.tree.leaves(_besides(self._simulation, states, steps, held)))]]


def _besides(simulation: Simulation, states: Any, steps: int, held: Held) -> tuple[Any, ...]:
    """What of a `SavedWorld` is not physics; every array with a world axis."""
    batch, kept = simulation._batch, None if simulation.core.rules is None else states
    return kept, batch.world.key, np.array([steps]), batch.controllers, held


def _world(simulation: Simulation) -> SavedWorld:
    physics = simulation.engine.snapshot(simulation.physics)
    world, held = simulation._batch.world, simulation._batch.grasps
    states, key, step, controllers, held = _besides(simulation, world.states, int(world.step[0]), held)
    return SavedWorld(physics, states, key[0], step, controllers, held)


def _names(simulation: Simulation) -> list[str]:
    return names_of(_world(simulation))


def _leaves(simulation: Simulation) -> list[np.ndarray]:
    """The present frame, without world axes."""
    world = _world(simulation)
    return [
        np.asarray(leaf) if name == "key" else np.asarray(leaf)[0, ...]
        for name, leaf in zip(names_of(world), jax.tree.leaves(world), strict=True)
    ]


def _origin(simulation: Simulation, version: int = FORMAT_VERSION) -> dict[str, Any]:
    engine, grasping = simulation.engine, simulation.core.grasping
    own = {
        "kind": KIND,
        "engine": engine.name,
        "substeps": engine.substeps,
        "timestep": engine.timestep,
        "grasping": "physical" if grasping is None else grasping.mode,
    }
    model = None if simulation.state_options is None else simulation.state_model
    return own | origin_of_states(model) | origin_of_scene(simulation.scene, version) | origin_of_machine()


def _same(a: Any, b: Any) -> bool:
    return a is b or np.asarray(a).tobytes() == np.asarray(b).tobytes()


def replayed(simulation: Simulation, recording: Recording) -> Replayed:
    here = _origin(simulation, recording.version)
    if recording.header.get("kind") != KIND:
        fix = "`ig2mj demos replay FILE` replays it"
        raise InputError(recording.file, "is a recording of an environment, not of a simulation", fix=fix)
    if bound := differences(recording.header, here, BINDING) + recording.missing_states(here):
        fix = "replay it in the simulation that it was recorded in"
        objects = missing_objects(recording.header, here)
        if objects:
            fix = "load the home with the same objects: load_scene(..., objects=[...])"
        raise InputError(recording.file, f"cannot be replayed: {'; '.join(objects or bound)}", fix=fix)
    names, like, labels = _names(simulation), _leaves(simulation), Labels(simulation.scene)
    tree = jax.tree.structure(_world(simulation))
    found, frames, runs = [], 0, [run for run in recording.runs if run.frames]
    initial = None if simulation.state_options is None else simulation._rules.initial
    lacking = plugin_columns(initial, [name.removeprefix("frames/") for name in recording.columns])
    for run in runs:
        if missing := [n for n in names if n not in (*run.names, *lacking)]:
            raise run.broken(f"frames/{missing[0]}", "is missing")
        for k, rows in enumerate(_frames(run, names, like, lacking)):
            frames += 1
            saved = _saved(names, rows, tree)
            if k == 0:
                put_world(simulation, saved)
            else:
                simulation._put(controllers=saved.controllers)
                simulation.step(np.asarray(saved.physics.ctrl)[0])
            difference = first_difference(labels, run.name, k, names, rows, _leaves(simulation), lacking)
            if difference is not None:
                found.append(difference)
                break
    return Replayed(len(runs), frames, found, differences(recording.header, here, LOOSE))


def _saved(names: list[str], rows: list[np.ndarray], tree: Any) -> SavedWorld:
    batched = [row if name == "key" else row[None] for name, row in zip(names, rows, strict=True)]
    return jax.tree.unflatten(tree, batched)


def _frames(run: Run, names: list[str], like: list[np.ndarray], lacking: dict[str, np.ndarray]) -> Any:
    for start in range(0, run.frames, FLUSH):
        rows = run.whole_frames(names, start, min(start + FLUSH, run.frames), like, lacking)
        for k in range(len(rows[0])):
            yield [array[k, ...] for array in rows]
