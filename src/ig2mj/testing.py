"""`api_test`: the contract of every environment, checked by random play.

    ig2mj.testing.api_test(ig2mj.make("CookingMeat", worlds=3))

Use it on environments of your own, too. It takes an environment with at least two worlds and some dozens of steps.
"""

from __future__ import annotations

import dataclasses
import pathlib
import tempfile
from typing import Any

import jax
import numpy as np
from jaxtyping import Float

from ig2mj.envs.environment import Environment, EnvState
from ig2mj.errors import ActionError, StaleStateError
from ig2mj.process import entry_point
from ig2mj.sensors.registry import sensor_named
from ig2mj.tasks.custom.objective import CustomObjective

SOON = 3
"""Steps before the horizon at which the end of an episode is looked at."""

ROUNDING = 1e-5
"""By which numbers of one world may differ that two programs computed."""

JUMPS = 0.01
"""Share of a world's rays that may jump where steps do not come out the same to the bit (`api_test`'s `within`)."""


@entry_point
def api_test(
    env: Environment,
    seed: int = 0,
    steps: int = 4,
    other: Environment | None = None,
    within: float = 0.0,
    astray: float = 0.0,
) -> None:
    """Raises AssertionError, with what is wrong, where an environment breaks a promise.

    - observations, rewards and flags have the stated shapes, types and ranges; info has the same keys in every step;
    - the same seed and actions give the same worlds, in a batch of any size (where `other` is given);
    - a reset of some worlds leaves the others bitwise alone;
    - the horizon truncates and does not terminate; nothing is both;
    - `final_obs` is what was seen before the reset;
    - numbers of an action that are not finite are refused on the host, on a device counted and taken for 0; a wrong
      shape is refused;
    - functions of the user's (`ig2mj.CustomTask`) give the same when they are called again, and a world's values do not
      depend on other worlds;
    - a stale state is refused by everything that takes a state; a fork of a state and a state from a file go
      on as the state itself, whatever was done to the others in between;
    - nothing is compiled again at the second reset and the second step; closing twice is harmless.

    Args:
      seed: of resets and actions. steps: of each part of the random play.
      other: the same environment with another number of worlds. It is not closed.
      within: by which numbers may differ, absolute and relative, when the same steps are taken again. On a GPU sums are
        made in any order, so that a step does not come out the same to the bit, and a ray that passed an edge narrowly
        may hit it. So of what a camera or a laser reads in a world, in each step, one ray in a hundred (one where there
        are fewer) may differ by any amount. Everything else, and all of it where `within` is 0, may not.
      astray: share of worlds in which everything may differ then. Where contacts come and go, as under a robot that
        tips as it starts to drive, rounding errors grow to centimetres within a few steps.
    """
    assert env.num_worlds >= 2, "api_test needs an environment with at least two worlds"
    like = Likeness(within, astray)
    rng = np.random.default_rng(seed)
    actions = [rng.uniform(-1, 1, (env.num_worlds, *env.action_space.shape)).astype(np.float32) for _ in range(steps)]

    first = _play(env, seed, actions)
    programs = _programs(env)
    again = _play(env, seed, actions)
    assert _programs(env) == programs, "the second reset and the second step compiled something again"
    for k, (a, b) in enumerate(zip(first, again, strict=True)):
        _same(a, b, f"step {k} of the same seed", like)
        assert set(a["info"]) == set(first[0]["info"]), f"step {k}: info has other keys than after the reset"
    if other is not None:
        _alike_in(other, seed, actions, first, Likeness(max(within, ROUNDING), astray))
    _spaces_hold(env, first)
    _partial_reset(env, seed, actions, like)
    _ends(env, seed, actions[0], like)
    _bad_actions(env, seed, like)
    _own_functions(env, seed, actions)
    _copies(env, seed, actions, like)
    env.close()
    env.close()


def _play(env: Environment, seed: int, actions: list[np.ndarray]) -> list[dict[str, Any]]:
    """What is seen after the reset and after every step, on the host."""
    state = env.reset(seed)
    found = [_host(state)]
    for action in actions:
        state = env.step(state, action)
        found.append(_host(state))
    return found


def _alike_in(
    other: Environment, seed: int, actions: list[np.ndarray], seen: list[dict[str, Any]], like: Likeness
) -> None:
    """The worlds that two batches have in common are the same, but for rounding: programs of other sizes are others."""
    assert other.num_worlds != len(actions[0]), "the other environment must have another number of worlds"
    common = np.arange(min(other.num_worlds, len(actions[0])))
    more = [np.resize(action, (other.num_worlds, *action.shape[1:])) for action in actions]
    for k, (a, b) in enumerate(zip(seen, _play(other, seed, more), strict=True)):
        what = f"step {k} in a batch of {other.num_worlds} instead of {len(actions[0])}"
        _same(_of(common, a), _of(common, b), what, like)


def _host(state: EnvState) -> dict[str, Any]:
    seen = {n: getattr(state, n) for n in ("obs", "reward", "terminated", "truncated", "info")}
    return jax.tree.map(lambda a: np.array(a), seen)


@dataclasses.dataclass(frozen=True)
class Likeness:
    """How alike worlds must be; see `api_test`."""

    within: float = 0.0
    astray: float = 0.0


def _same(a: Any, b: Any, what: str, like: Likeness) -> None:
    """Arrays of all worlds are the same, those of floats to so much, absolute and relative, but for worlds astray."""
    different: dict[str, np.ndarray] = {}
    within = like.within
    for (path, x), (_, y) in zip(
        jax.tree_util.tree_leaves_with_path(a), jax.tree_util.tree_leaves_with_path(b), strict=True
    ):
        close = within if np.issubdtype(x.dtype, np.floating) else 0.0
        differs = ~np.isclose(x, y, rtol=close, atol=close) if close else x != y
        name = str(getattr(path[-1], "key", ""))
        sensor = sensor_named(name)
        if within and sensor is not None and sensor.looks:
            rays = differs.any(-1).reshape(len(differs), -1)
            differs = rays.sum(1) > max(1, int(JUMPS * rays.shape[1]))
        if differs.any():
            different[jax.tree_util.keystr(path)] = differs.reshape(len(differs), -1).any(1)
    worlds = np.logical_or.reduce(list(different.values())) if different else np.zeros(1, bool)
    allowed = like.astray if within else 0.0
    assert worlds.mean() <= allowed, f"{what}: {', '.join(different)} differs in {worlds.sum()} of {len(worlds)} worlds"


def _of(worlds: np.ndarray, seen: Any) -> Any:
    return jax.tree.map(lambda a: a[worlds], seen)


def _programs(env: Environment) -> int:
    """How many programs the environment's own functions were compiled to."""
    jitted = [f for f in vars(env).values() if hasattr(f, "_cache_size")]
    return sum(f._cache_size() for f in jitted)


def _spaces_hold(env: Environment, seen: list[dict[str, Any]]) -> None:
    for k, step in enumerate(seen):
        assert set(step["obs"]) == set(env.observation_spaces), f"step {k}: other observations than spaces"
        for name, space in env.observation_spaces.items():
            array = step["obs"][name]
            assert array.shape == (env.num_worlds, *space.shape), f"step {k}: {name} has shape {array.shape}"
            assert array.dtype == space.dtype, f"step {k}: {name} is of {array.dtype}"
            assert np.isfinite(array).all(), f"step {k}: {name} has numbers that are not finite"
            assert (array >= space.low).all() and (array <= space.high).all(), f"step {k}: {name} is out of range"
        for name, kind in (("reward", np.float32), ("terminated", np.bool_), ("truncated", np.bool_)):
            assert step[name].shape == (env.num_worlds,), f"step {k}: {name} has shape {step[name].shape}"
            assert step[name].dtype == kind, f"step {k}: {name} is of {step[name].dtype}"
        assert np.isfinite(step["reward"]).all(), f"step {k}: a reward is not finite"
        assert not (step["terminated"] & step["truncated"]).any(), f"step {k}: a world is terminated and truncated"
        terms = [array for name, array in step["info"].items() if name.startswith("reward/")]
        assert np.allclose(np.sum(terms, axis=0), step["reward"], atol=1e-5), f"step {k}: terms are not the reward"


def _partial_reset(env: Environment, seed: int, actions: list[np.ndarray], like: Likeness) -> None:
    state = env.reset(seed)
    for action in actions:
        state = env.step(state, action)
    before, mask = _host(state), np.arange(env.num_worlds) % 2 == 0
    state = env.reset(state, mask)
    after = _host(state)
    _same(_of(~mask, before), _of(~mask, after), "worlds that were not reset", Likeness())
    assert (after["info"]["steps"][mask] == 0).all(), "a world that was reset does not count its steps from 0"
    assert (after["info"]["steps"][~mask] == len(actions)).all(), "a reset changed the steps of other worlds"
    for action in actions:
        state = env.step(state, action)
    alone = _play(env, seed, actions + actions)[-1]
    _same(_of(~mask, _host(state)), _of(~mask, alone), "worlds next to others that were reset", like)


def _ends(env: Environment, seed: int, action: Float[np.ndarray, "W n"], like: Likeness) -> None:
    """The horizon truncates, and `final_obs` is what was seen before."""
    soon = min(SOON, env.task.horizon)
    state = _aged(env, env.reset(seed), env.task.horizon - soon)
    for _ in range(soon):
        state = env.step(state, action)
    last = _host(state)
    state = _aged(env, env.reset(seed), env.task.horizon - soon)
    for _ in range(soon):
        state = env.step_autoreset(state, action)
    over = last["terminated"] | last["truncated"]
    assert over.all(), "episodes do not end at the horizon"
    assert (last["truncated"] == ~last["terminated"]).all(), "the horizon terminates instead of truncating"
    _same(last["obs"], jax.tree.map(np.array, state.info["final_obs"]), "final_obs", like)
    assert (np.asarray(state.batch.world.step) == 0).all(), "autoreset did not start a new episode"


def _aged(env: Environment, state: EnvState, steps: int) -> EnvState:
    """The same state so many agent steps later in its episodes. With another horizon all would be compiled again."""
    engine, world = env.core.engine, state.batch.world
    control_steps = np.int32(steps * round(env.period / (engine.substeps * engine.timestep)))
    world = dataclasses.replace(world, step=world.step + control_steps)
    return dataclasses.replace(state, batch=dataclasses.replace(state.batch, world=world))


def _bad_actions(env: Environment, seed: int, like: Likeness) -> None:
    shape = (env.num_worlds, *env.action_space.shape)
    nan = np.zeros(shape, np.float32)
    nan[0, 0] = np.nan
    state = env.step(env.reset(seed), jax.numpy.asarray(nan))
    assert np.asarray(state.info["bad_actions"]).tolist() == [1] + [0] * (env.num_worlds - 1), "NaN is not counted"
    bad = _host(state)
    fine = _host(env.step(env.reset(seed), np.zeros(shape, np.float32)))
    _same(bad["obs"], fine["obs"], "NaN in place of 0", like)
    shapes = (np.zeros(shape[1:], np.float32), np.zeros((shape[0], shape[1] + 1), np.float32))
    for wrong, what in (*((a, f"of shape {a.shape}") for a in shapes), (nan, "with NaN")):
        try:
            env.step(env.reset(seed), wrong)
        except ActionError:
            continue
        raise AssertionError(f"an action {what} was taken")


def _own_functions(env: Environment, seed: int, actions: list[np.ndarray]) -> None:
    """Rewards, ends and observations of the user's, on values of some steps."""
    if not isinstance(env.objective, CustomObjective):
        return
    state = env.reset(seed)
    for action in actions:
        state = env.step(state, action)
    world = state.batch.world
    env.objective.check_pure(*jax.tree.map(np.asarray, (world.view, world.states, state.status)))


def _copies(env: Environment, seed: int, actions: list[np.ndarray], like: Likeness) -> None:
    """Used states are refused; copies go on alike, one after the other and in turn."""
    used = env.reset(seed)
    state = env.step(used, actions[0])
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "state.npz"
        for name, take in {
            "step": lambda: env.step(used, actions[0]),
            "step_autoreset": lambda: env.step_autoreset(used, actions[0]),
            "reset": lambda: env.reset(used),
            "fork": lambda: env.fork(used),
            "save": lambda: env.save(used, file),
            "engine.view": lambda: env.core.engine.view(used.batch.world.physics),
        }.items():
            try:
                take()
            except StaleStateError:
                continue
            raise AssertionError(f"{name} took a stale state")
        env.save(state, file)
        copies = {"a fork": env.fork(state), "a state from a file": env.load(file)}
    _same(_host(state), _host(copies["a state from a file"]), "a state from a file", Likeness())
    going = {"the state": state, **copies}
    for k, action in enumerate(actions):
        going = {what: env.step(one, action if what == "the state" else -action) for what, one in going.items()}
        if k == 0:
            before = env.fork(going["a fork"])
    alone = env.reset(seed)
    for action in (actions[0], *(-action for action in actions)):
        alone = env.step(alone, action)
    for what in copies:
        _same(_host(alone), _host(going[what]), f"{what}, in turn with others", like)
    for action in actions[1:]:
        before = env.step(before, -action)
    _same(_host(alone), _host(before), "a fork of a fork", like)
