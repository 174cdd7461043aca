"""Measuring how large the Warp engine's buffers must be for a scene: it is disturbed, and the peaks are kept.

Where there is a GPU, the Warp engine itself is measured, in many worlds. Else C MuJoCo is: it lists about as many
contacts and constraint rows (four contacts per face against face, where Warp keeps up to as many), so the safety factor
is larger.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from ig2mj.agents.pushing import Pusher, push, start_pushing
from ig2mj.agents.reach import Reach
from ig2mj.engine.native import NativeEngine
from ig2mj.engine.profile import EngineProfile, default_profile
from ig2mj.engine.settle import settle
from ig2mj.engine.warp import WarpEngine
from ig2mj.errors import EngineError
from ig2mj.sampling.perturbation import loose_objects, perturb
from ig2mj.scene.scene import Scene
from ig2mj.worlds.random_streams import episode_keys

SAFETY = {"warp": 1.5, "native": 2.0}
"""Factor on the measured peaks."""

SHARE, AT_LEAST = 0.08, 3
"""Share of the loose objects that are dropped at the start of a round, on average: a few at once. In small scenes as
many as this, on average."""

ROUND = 60
"""Control steps of a round; then every world starts afresh."""

ALIGN = 4
"""Sizes are rounded up to a multiple of this."""

Progress = Callable[[int, int], None]


def calibrate(
    scene: Scene,
    reach: Reach | None = None,
    *,
    engine: str = "",
    num_worlds: int = 0,
    rounds: int = 6,
    seed: int = 0,
    safety: float = 0.0,
    progress: Progress = lambda done, total: None,
) -> EngineProfile:
    """Measures a scene.

    Args:
      scene: with or without an agent.
      reach: of the floating hand that is its only agent; it pushes objects about. None: things are only dropped.
      engine: "warp" or "native"; "": warp where JAX has a GPU.
      num_worlds: measured side by side; 0: 1,024 on warp, 8 on native.
      rounds: of two simulated seconds each.
      seed: of the disturbance.
      safety: factor on the peaks; 0: `SAFETY`.
      progress: called with rounds done and in all.

    Raises:
      EngineError: no such engine, or the measurement itself overflowed.
    """
    engine = engine or ("warp" if jax.default_backend() == "gpu" else "native")
    if engine not in SAFETY:
        raise EngineError(f"there is no engine '{engine}' to calibrate with (engines: {', '.join(SAFETY)})")
    worlds = num_worlds or {"warp": 1024, "native": 8}[engine]
    measure = _measure_warp if engine == "warp" else _measure_native
    peaks = measure(scene, reach, worlds, rounds, seed, progress)
    factor = safety or SAFETY[engine]
    widest = default_profile(scene.model)
    names = ("awake_dofs", "constraints", "contacts", "convex_contacts")
    sizes = {n: ALIGN * math.ceil(max(1.0, factor * peaks[n]) / ALIGN) for n in names}
    sizes["awake_dofs"] = min(sizes["awake_dofs"], widest.awake_dofs)
    # Contacts come as one list for all worlds: its average is what counts, with room for a batch that is all disturbed.
    return EngineProfile(
        **sizes,
        measured={
            **{f"peak_{n}": round(float(peaks[n]), 2) for n in names},
            "engine": engine,
            "worlds": worlds,
            "rounds": rounds,
            "seed": seed,
            "safety": factor,
            "mujoco": mujoco.__version__,
        },
    )


class _Disturbance:
    """What happens to the worlds of a measurement: drops at the start of each round, a hand that pushes, if any."""

    def __init__(self, scene: Scene, reach: Reach | None, engine: NativeEngine | WarpEngine, seed: int):
        self.scene, self.reach, self.engine, self.seed = scene, reach, engine, seed
        self.loose = loose_objects(scene.tables)
        self.seconds = engine.substeps * engine.timestep

    def key(self, round_number: int | jax.Array) -> jax.Array:
        worlds = jnp.arange(self.engine.num_worlds)
        return jnp.asarray(episode_keys(self.seed, worlds, jnp.full_like(worlds, round_number)))

    def start(self) -> Pusher | None:
        return start_pushing(self.reach, self.engine.num_worlds, self.scene.model.nu) if self.reach else None

    def drop(self, view, key: jax.Array):  # a Write
        share = max(SHARE, min(1.0, AT_LEAST / max(1, len(self.loose))))
        return perturb(self.scene.tables, self.loose, view, key, share)

    def controls(self, view, pusher: Pusher | None, key: jax.Array, step: jax.Array) -> Pusher | None:
        if self.reach is None or pusher is None:
            return None
        return push(self.reach, pusher, view.object_com, view.agent_pos[:, 0], key, step, self.seconds)


def _measure_native(
    scene: Scene, reach: Reach | None, worlds: int, rounds: int, seed: int, progress: Progress
) -> dict[str, float]:
    engine = NativeEngine(scene, worlds)
    start = settle(scene)
    physics = engine.load(engine.reset(), start)
    act = _Disturbance(scene, reach, engine, seed)
    drop, controls = jax.jit(act.drop), jax.jit(act.controls)
    peaks: dict[str, float] = dict.fromkeys(("awake_dofs", "constraints", "contacts", "convex_contacts"), 0.0)
    for number in range(rounds):
        physics = engine.load(physics, start)
        key = act.key(number)
        view = engine.view(physics)
        physics = engine.write(physics, jax.device_get(drop(view, key)))
        pusher = act.start()
        for step in range(ROUND):
            physics, view = engine.step(physics, None if pusher is None else np.asarray(pusher.ctrl))
            pusher = controls(view, pusher, key, jnp.full(worlds, step))
            total = 0
            for w in range(worlds):
                data = engine.to_mujoco(physics, w)[1]
                peaks["awake_dofs"] = max(peaks["awake_dofs"], float(data.nv_awake))
                peaks["constraints"] = max(peaks["constraints"], float(data.nefc))
                total = max(total, data.ncon)
            peaks["contacts"] = peaks["convex_contacts"] = max(peaks["contacts"], float(total))
        progress(number + 1, rounds)
    return peaks


def _measure_warp(
    scene: Scene, reach: Reach | None, worlds: int, rounds: int, seed: int, progress: Progress
) -> dict[str, float]:
    engine = WarpEngine(scene, worlds, profile=default_profile(scene.model), initial=settle(scene))
    act = _Disturbance(scene, reach, engine, seed)
    first = engine.reset()

    def one_round(physics, number):
        key = act.key(number)
        view = engine.view(physics)
        physics = engine.write(physics, act.drop(view, key))

        def body(carry, step):
            physics, view, pusher = carry
            pusher = act.controls(view, pusher, key, jnp.full(worlds, step))
            physics, view = engine.step(physics, None if pusher is None else pusher.ctrl)
            use = engine.usage(physics)
            use = jnp.array(
                [use.awake_dofs.max(), use.constraints.max(), use.contacts / worlds, use.convex_contacts / worlds]
            )
            return (physics, view, pusher), use

        (physics, _, _), use = jax.lax.scan(body, (physics, view, act.start()), jnp.arange(ROUND))
        return use.max(0), engine.health(physics)

    run = jax.jit(one_round)
    peaks = np.zeros(4)
    for number in range(rounds):
        use, _ = run(first, number)
        peaks = np.maximum(peaks, np.asarray(use))
        progress(number + 1, rounds)
    return dict(zip(("awake_dofs", "constraints", "contacts", "convex_contacts"), map(float, peaks), strict=True))
