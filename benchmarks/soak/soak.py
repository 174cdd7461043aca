"""Random controls at full range, for very many steps: how often does what leave the house or move too fast?

    python -m benchmarks.soak.soak [HOME ...] [--world-steps 4e7] [--worlds 8192] [--engine warp] [--out DIR]
    python -m benchmarks.soak.soak --replay DIR/birch_world12.npz

A floating hand of 300 N gets a new target in one of twenty control steps: a place anywhere in the house, any turn, any
grip. A world is flagged where a buffer overflowed, a number is not finite, an object fell out of the house, is beside
its floors, or moved faster than 20 m/s (`ig2mj.worlds.guards`); it counts once, with the object and with the geoms
that this object touched last, and starts afresh. A world-step is a physics step of one world (1/120 s).

A few flagged worlds are dumped: where they were up to two seconds before, and the controls since. `--replay` runs such
a dump on the native engine and lists what the object met; how it goes on there differs after the first contacts.
"""

from __future__ import annotations

import collections
import dataclasses
import json
import pathlib
import time
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import tyro
from flax import struct
from jaxtyping import Float, Int

from benchmarks.harness.batch_case import Case
from benchmarks.soak.replay import Dump, replay
from benchmarks.soak.watch import FLAGS, House, Seen, Watch
from ig2mj.agents.floating_hand import FINGER_CLOSED, THUMB_CLOSED
from ig2mj.engine.native.engine import NativeEngine
from ig2mj.engine.snapshot import Snapshot
from ig2mj.engine.view import Array
from ig2mj.engine.warp.engine import WarpEngine
from ig2mj.worlds.random_streams import episode_keys, pick_rows, step_keys

STEPS = 15
"""Control steps of one call; flagged worlds start afresh after it."""

KEPT = 4
"""Calls whose starts are kept for dumps."""

EPISODE = 600
"""Control steps after which a world starts afresh in any case."""

NEW_TARGET = 1 / 20


@dataclasses.dataclass
class Args:
    """What to run."""

    homes: tyro.conf.Positional[tuple[str, ...]] = ("birch", "fir", "spruce")
    """Homes, by name or folder."""
    world_steps: float = 4e7
    """Physics steps of all worlds together, for each home."""
    worlds: int = 8192
    """Worlds side by side."""
    engine: str = "warp"
    """warp or native (few worlds then)."""
    seed: int = 0
    """Of the random streams."""
    dumps: int = 4
    """Worlds dumped for each home."""
    minutes: float = 30.0
    """Time limit for each home, without making it ready."""
    out: pathlib.Path = pathlib.Path("out/benchmarks/soak")
    """Folder for rows (soak.jsonl) and dumps."""
    replay: pathlib.Path | None = None
    """Replays this dump and does nothing else."""


@struct.dataclass
class Soak:
    """A batch: physics and what was seen of it, and the clocks of its random streams."""

    physics: Any
    seen: Seen
    ctrl: Float[Array, "W nu"]
    episode: Int[Array, "W"]
    step: Int[Array, "W"]


def controls(house: House, key: Array, step: Int[Array, "W"], before: Float[Array, "W nu"]) -> Float[Array, "W nu"]:
    """The controls of the next control step: those before, or a new target anywhere in the house.

    Args:
      key: of each world's episode. step: control steps since its start. before: the last controls.
    """
    size = before.shape[1]
    draw = jax.vmap(lambda k: jax.random.uniform(k, (8,)))(step_keys(key, step))
    place = house.low + draw[:, 1:4] * (house.high - house.low) - house.start
    turn = (2 * draw[:, 4:7] - 1) * jnp.pi
    closed = jnp.full(10, FINGER_CLOSED).at[:2].set(THUMB_CLOSED) * draw[:, 7:8]
    target = jnp.concatenate([place, turn, closed], axis=1)[:, :size].astype(jnp.float32)
    return jnp.where((draw[:, :1] < NEW_TARGET) | (step == 0)[:, None], target, before)


class Run:
    """One home under random controls."""

    def __init__(self, case: Case, args: Args):
        self.case, self.args = case, args
        scene, count = case.scene, args.worlds
        initial = jax.tree.map(lambda a: a[0], case.pool.physics)
        if args.engine == "warp":
            self.engine = WarpEngine(scene, count, profile=case.profile.for_worlds(count), initial=initial)
        else:
            self.engine = NativeEngine(scene, count)
        self.watch = Watch(self.engine, case.reach.start)
        self.rows = jax.tree.map(lambda a: np.asarray(a), case.pool.physics)
        pure = self.engine.pure
        self._many = jax.jit(self._steps, donate_argnums=0) if pure else self._steps
        self._fresh = jax.jit(self._restart, donate_argnums=0) if pure else self._restart
        self.snapshot = jax.jit(self._copy) if pure else self._copy
        self._controls = jax.jit(lambda key, step, before: controls(self.watch.house, key, step, before))
        self.lasting = STEPS * self.engine.substeps * count

    def _copy(self, physics: Any) -> Snapshot:
        """All worlds; in arrays of their own, since the next call is given those of the physics."""
        return jax.tree.map(jnp.copy if self.engine.pure else np.array, self.engine.snapshot(physics))

    def start(self) -> Soak:
        count, size = self.args.worlds, self.engine.scene.model.nu
        physics = self.engine.reset()
        zero = jnp.zeros(count, jnp.int32)
        soak = Soak(physics, self.watch.start(physics), jnp.zeros((count, size), jnp.float32), zero - 1, zero + 0)
        return self._fresh(soak, jnp.ones(count, bool))

    def _keys(self, episode: Int[Array, "W"]) -> Array:
        return episode_keys(self.args.seed, jnp.arange(self.args.worlds, dtype=jnp.int32), episode)

    def _restart(self, soak: Soak, mask: Array) -> Soak:
        episode = jnp.where(mask, soak.episode + 1, soak.episode)
        rows = jax.tree.map(lambda a: jnp.asarray(a)[pick_rows(self._keys(episode), len(self.rows.qpos))], self.rows)
        if not self.engine.pure:
            rows = jax.tree.map(np.asarray, rows)
        physics = self.engine.load(soak.physics, rows, mask if self.engine.pure else np.asarray(mask))
        return Soak(
            physics,
            self.watch.fresh(soak.seen, physics, mask),
            jnp.where(mask[:, None], 0.0, soak.ctrl),
            episode,
            jnp.where(mask, 0, soak.step),
        )

    def _step(self, soak: Soak, _: Any) -> tuple[Soak, None]:
        ctrl = self._controls(self._keys(soak.episode), soak.step, soak.ctrl)
        physics, view = self.engine.step(soak.physics, ctrl if self.engine.pure else np.asarray(ctrl))
        return Soak(physics, self.watch.look(soak.seen, physics, view), ctrl, soak.episode, soak.step + 1), None

    def _steps(self, soak: Soak) -> Soak:
        if self.engine.pure:
            return jax.lax.scan(self._step, soak, None, STEPS)[0]
        for _ in range(STEPS):
            soak, _ = self._step(soak, None)
        return soak

    def dump(self, starts: list[tuple[Snapshot, np.ndarray, np.ndarray, np.ndarray]], soak: Soak, world: int) -> Dump:
        """The world's oldest start of its present episode, and its controls from there to now."""
        episode = int(soak.episode[world])
        physics, ctrl, _, step = next(s for s in starts if s[2][world] == episode)
        key = self._keys(jnp.asarray(soak.episode))
        past, before, since = [], jnp.asarray(ctrl), jnp.asarray(step)
        for k in range(int(soak.step[world]) - int(step[world])):
            before = self._controls(key, since + k, before)
            past.append(np.asarray(before[world]))
        row = jax.tree.map(lambda a: np.asarray(a[world]), physics)
        report = self.watch.report(soak.seen, world)
        return Dump(self.case.scene.folder.name, tuple(self.case.reach.start), report, row, np.array(past))


def soak(home: str, args: Args) -> dict[str, Any]:
    """Runs one home; what was counted."""
    case = Case(home, hand=True)
    run = Run(case, args)
    state, starts, dumped = run.start(), collections.deque(maxlen=KEPT), 0
    events: list[dict[str, Any]] = []
    done, began, timed, timed_steps = 0, time.monotonic(), 0.0, 0
    while done < args.world_steps and time.monotonic() - began < 60 * args.minutes:
        starts.append((run.snapshot(state.physics), *(np.array(a) for a in (state.ctrl, state.episode, state.step))))
        start = time.monotonic()
        state = jax.block_until_ready(run._many(state)) if run.engine.pure else run._many(state)
        if done:
            timed, timed_steps = timed + time.monotonic() - start, timed_steps + run.lasting
        done += run.lasting
        flags = np.asarray(state.seen.flags)
        for world in np.flatnonzero(flags):
            events.append(run.watch.report(state.seen, int(world)))
            if dumped < args.dumps and events[-1]["kind"] != "overflow":
                run.dump(list(starts), state, int(world)).save(args.out / f"{case.scene.name}_world{world}.npz")
                dumped += 1
        over = (flags != 0) | (np.asarray(state.step) >= EPISODE)
        if over.any():
            state = run._fresh(state, jnp.asarray(over))
    kinds = collections.Counter(event["kind"] for event in events)
    return {
        "home": case.scene.name,
        "engine": args.engine,
        "worlds": args.worlds,
        "world_steps": done,
        "world_steps_per_s": round(timed_steps / timed) if timed else None,
        "flagged": {kind: kinds.get(kind, 0) for kind in FLAGS},
        "per_million": {kind: round(1e6 * kinds.get(kind, 0) / done, 4) for kind in FLAGS},
        "objects": {
            kind: dict(collections.Counter(e["object"] for e in events if e["kind"] == kind).most_common(8))
            for kind in kinds
        },
        "touched_last": {
            kind: dict(collections.Counter(g for e in events if e["kind"] == kind for g in e["touched"]).most_common(8))
            for kind in kinds
        },
        "events": events[:50],
    }


def main(args: Args) -> list[dict[str, Any]]:
    if args.replay is not None:
        replay(args.replay)
        return []
    args.out.mkdir(parents=True, exist_ok=True)
    rows = []
    for home in args.homes:
        rows.append(soak(home, args))
        line = json.dumps(rows[-1])
        print(line, flush=True)
        with (args.out / "soak.jsonl").open("a") as file:
            file.write(line + "\n")
    return rows


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
