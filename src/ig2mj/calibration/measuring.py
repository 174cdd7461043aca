"""Measuring how large the Warp engine's buffers must be for a scene: it is disturbed, and what it asks for is counted.

C MuJoCo is measured first, in a few worlds: it tells the pairs of the broad phase, which Warp does not, and gives the
sizes to begin with. Where there is a GPU, the Warp engine itself is measured then, in many worlds, and again with
larger buffers where some overflow. Without one, C MuJoCo is all there is: it lists about as many contacts and
constraint rows (four contacts per face against face, where Warp keeps up to as many), so a factor is put on top.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import msgspec
import mujoco
import numpy as np

from ig2mj.calibration.acting import ACTION_STEPS, Acting, act_at_random, robot_of, start_acting
from ig2mj.calibration.pushing import Pusher, push, start_pushing
from ig2mj.calibration.reach import Reach
from ig2mj.callbacks import ProgressCallback, no_progress
from ig2mj.engine.health import CAPACITY, SETTING
from ig2mj.engine.mjx.contacts import warp_contacts
from ig2mj.engine.native.engine import NativeEngine
from ig2mj.engine.native.settle import settle
from ig2mj.engine.snapshot import Snapshot
from ig2mj.engine.warp.buffer_sizes import QUANTITIES, Measurement, Tail, profile_of
from ig2mj.engine.warp.candidate_pairs import CandidatePairs
from ig2mj.engine.warp.engine import WarpEngine
from ig2mj.engine.warp.profile import EngineProfile, default_profile
from ig2mj.errors import EngineError
from ig2mj.process import entry_point
from ig2mj.sampling.perturbation import loose_objects, perturb
from ig2mj.scene.scene import Scene
from ig2mj.worlds.random_streams import episode_keys

SAFETY = {"warp": 1.0, "native": 1.4}
"""Factor on all measured sizes (`ig2mj.engine.warp.buffer_sizes` has the sizes without a measurement)."""

WORLDS = {"warp": 1024, "native": 16}

FIRST_GUESS, WIDEN, TRIES = 1.5, 2.0, 4
"""Factors on the sizes from C MuJoCo, to measure Warp with; on a buffer that overflows; how often that may happen."""

SHARE, AT_LEAST = 0.08, 3
"""Share of the loose objects that are dropped at the start of a round, on average: a few at once. In small scenes as
many as this, on average."""

ROUND = 60
"""Control steps of a round; then every world starts afresh."""

BINS = 1 << 14
"""Counts of constraint rows and of contacts are kept up to this; more is counted as this much."""


@entry_point
def calibrate(
    scene: Scene,
    reach: Reach | None = None,
    *,
    engine: str = "",
    num_worlds: int = 0,
    rounds: int = 6,
    seed: int = 0,
    safety: float = 0.0,
    progress: ProgressCallback = no_progress,
) -> EngineProfile:
    """Measures a scene.

    Args:
      scene: with or without an agent; a robot that is its first agent acts at random.
      reach: of the floating hand that is its only agent; it pushes objects about. None: objects are only dropped.
      engine: "warp" or "native"; "": warp where JAX has a GPU.
      num_worlds: measured side by side; 0: `WORLDS`.
      rounds: of two simulated seconds each.
      seed: of the disturbance.
      safety: factor on the sizes; 0: `SAFETY`.
      progress: called with rounds done and in all.

    Raises:
      EngineError: no such engine, or the measurement itself overflowed time and again.
    """
    engine = engine or ("warp" if jax.default_backend() == "gpu" else "native")
    if engine not in SAFETY:
        raise EngineError(f"there is no engine '{engine}' to calibrate with (engines: {', '.join(SAFETY)})")
    worlds = num_worlds or WORLDS[engine]
    start = settle(scene)
    first = engine == "warp"
    native_rounds = 1 if first else rounds
    measured = _measure_native(
        scene,
        reach,
        start,
        min(worlds, WORLDS["native"]) if first else worlds,
        native_rounds,
        seed,
        lambda done, _, text="": progress(done, native_rounds + (rounds if first else 0)),
    )
    if first:
        on_warp = _measure_warp(
            scene, reach, start, measured, worlds, rounds, seed, lambda d, n, text="": progress(d + 1, (n or 0) + 1)
        )
        measured = Measurement(
            tails={**measured.tails, **on_warp.tails},
            means={n: max(measured.means[n], on_warp.means.get(n, 0.0)) for n in measured.means},
        )
    factor = safety or SAFETY[engine]
    return msgspec.structs.replace(
        profile_of(measured, scene.model, factor),
        measured={
            **measured.summary(),
            "engine": engine,
            "worlds": worlds,
            "rounds": rounds,
            "seed": seed,
            "safety": factor,
            "mujoco": mujoco.__version__,
        },
    )


class _Disturbance:
    """What happens to the worlds of a measurement: drops at the start of each round; a hand that pushes, or a robot."""

    def __init__(self, scene: Scene, reach: Reach | None, engine: NativeEngine | WarpEngine, seed: int):
        self.scene, self.reach, self.engine, self.seed = scene, reach, engine, seed
        self.loose = loose_objects(scene.tables)
        self.seconds = engine.substeps * engine.timestep
        self.robot = None if reach else robot_of(scene, ACTION_STEPS * self.seconds)

    def key(self, round_number: int | jax.Array) -> jax.Array:
        worlds = jnp.arange(self.engine.num_worlds)
        return jnp.asarray(episode_keys(self.seed, worlds, jnp.full_like(worlds, round_number)))

    def start(self) -> Pusher | Acting | None:
        if self.robot is not None:
            return start_acting(self.robot, self.engine.num_worlds, self.scene.model.nu)
        return start_pushing(self.reach, self.engine.num_worlds, self.scene.model.nu) if self.reach else None

    def drop(self, view, key: jax.Array):  # a Write
        share = max(SHARE, min(1.0, AT_LEAST / max(1, len(self.loose))))
        return perturb(self.scene.tables, self.loose, view, key, share)

    def controls(self, view, pusher: Pusher | Acting | None, key: jax.Array, step: jax.Array) -> Pusher | Acting | None:
        if isinstance(pusher, Acting):
            assert self.robot is not None
            return act_at_random(self.robot, pusher, view, key, step)
        if self.reach is None or pusher is None:
            return None
        return push(self.reach, pusher, view.object_com, view.agent.base_pos[:, 0], key, step, self.seconds)


def _measure_native(
    scene: Scene, reach: Reach | None, start: Snapshot, worlds: int, rounds: int, seed: int, progress: ProgressCallback
) -> Measurement:
    engine = NativeEngine(scene, worlds)
    pairs = CandidatePairs(scene.model)
    physics = engine.load(engine.reset(), start)
    act = _Disturbance(scene, reach, engine, seed)
    drop, controls = jax.jit(act.drop), jax.jit(act.controls)
    seen = np.zeros((rounds, ROUND, worlds, len(QUANTITIES)), np.int64)
    for number in range(rounds):
        physics = engine.load(physics, start)
        key = act.key(number)
        physics = engine.write(physics, jax.device_get(drop(engine.view(physics), key)))
        pusher = act.start()
        for step in range(ROUND):
            physics, view = engine.step(physics, None if pusher is None else np.asarray(pusher.ctrl))
            pusher = controls(view, pusher, key, jnp.full(worlds, step))
            for w in range(worlds):
                data = engine.to_mujoco(physics, w)[1]
                seen[number, step, w] = data.nv_awake, data.nefc, data.ncon, pairs.count(data)
        progress(number + 1, rounds)
    means = seen.mean(2).max((0, 1))
    return Measurement(
        tails={name: Tail.of(seen[..., k]) for k, name in enumerate(QUANTITIES)},
        means={name: float(means[k]) for k, name in enumerate(QUANTITIES) if name in ("contacts", "pairs")},
    )


def _measure_warp(
    scene: Scene,
    reach: Reach | None,
    start: Snapshot,
    native: Measurement,
    worlds: int,
    rounds: int,
    seed: int,
    progress: ProgressCallback,
) -> Measurement:
    """As the Warp engine sees it; with larger buffers, until they hold everything."""
    profile = profile_of(native, scene.model, FIRST_GUESS)
    for _ in range(TRIES):
        measured, overflow = _count_warp(scene, reach, start, profile, worlds, rounds, seed, progress)
        if not overflow:
            return measured
        profile = _wider(profile, overflow, scene.model)
    raise EngineError(
        f"buffers overflow in scene '{scene.name}' even at {profile} (does anything in it explode? try `ig2mj view`)"
    )


def _wider(profile: EngineProfile, overflow: int, model: mujoco.MjModel) -> EngineProfile:
    """The profile with what overflowed (flags of capacity) made larger."""
    names = {SETTING[flag] for flag in SETTING if overflow & flag} or set(SETTING.values())
    names |= {f"spare_{n}" for n in names if n in ("contacts", "convex_contacts")}
    larger = {n: int(WIDEN * getattr(profile, n)) for n in names}
    widest = default_profile(model)
    if "awake_dofs" in larger:
        larger["awake_dofs"] = min(larger["awake_dofs"], widest.awake_dofs)
    return msgspec.structs.replace(profile, **larger)


def _count_warp(
    scene: Scene,
    reach: Reach | None,
    start: Snapshot,
    profile: EngineProfile,
    worlds: int,
    rounds: int,
    seed: int,
    progress: ProgressCallback,
) -> tuple[Measurement, int]:
    """One measurement, and the capacity flags that any world raised (its count then leaves objects out)."""
    engine = WarpEngine(scene, worlds, profile=profile.for_worlds(worlds), initial=start)
    act = _Disturbance(scene, reach, engine, seed)
    bins = {"awake_dofs": scene.model.nv + 1, "constraints": BINS, "contacts": BINS}

    def one_round(physics, number):
        key = act.key(number)
        view = engine.view(physics)
        physics = engine.write(physics, act.drop(view, key))

        def body(carry, step):
            physics, view, pusher, tails, mean = carry
            pusher = act.controls(view, pusher, key, jnp.full(worlds, step))
            physics, view = engine.step(physics, None if pusher is None else pusher.ctrl)
            use, contacts = engine.usage(physics), warp_contacts(physics.data)
            own = jnp.zeros(worlds, jnp.int32)
            own = own.at[jnp.where(contacts.valid, contacts.world, worlds)].add(1, mode="drop")
            now = {"awake_dofs": use.awake_dofs, "constraints": use.constraints, "contacts": own}
            tails = {n: tails[n].at[jnp.clip(now[n], 0, bins[n] - 1)].add(1) for n in bins}
            return (physics, view, pusher, tails, jnp.maximum(mean, use.contacts / worlds)), None

        tails = {name: jnp.zeros(count, jnp.int32) for name, count in bins.items()}
        carry = (physics, view, act.start(), tails, jnp.float32(0.0))
        (physics, _, _, tails, mean), _ = jax.lax.scan(body, carry, jnp.arange(ROUND))
        flags = jax.lax.reduce(engine.health(physics).overflow, jnp.int32(0), jax.lax.bitwise_or, (0,))
        return tails, mean, flags & int(CAPACITY)

    run, first = jax.jit(one_round), engine.reset()
    measured, overflow = None, 0
    for number in range(rounds):
        tails, mean, flags = run(first, number)
        part = Measurement({n: Tail(np.asarray(c, np.int64)) for n, c in tails.items()}, {"contacts": float(mean)})
        measured, overflow = part if measured is None else measured.joined(part), overflow | int(flags)
        progress(number + 1, rounds)
        if overflow:
            break
    assert measured is not None
    return measured, overflow
