"""`ig2mj web SCENE|TASK|FILE`: the viewer in the browser, for machines without a display."""

from __future__ import annotations

import pathlib
from typing import TYPE_CHECKING, Annotated

import tyro

from ig2mj.cli.common.objects import AddedObjects
from ig2mj.cli.common.own_robot import NONE, Own, choose_robot
from ig2mj.cli.common.tasks import TaskOption, use_task
from ig2mj.errors import Ig2mjError, UnknownNameError

if TYPE_CHECKING:
    from ig2mj.web.sources import Source

_RECORDINGS = (".h5", ".hdf5")


def run(
    what: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SCENE|TASK|FILE")],
    port: int = 8080,
    host: str | None = None,
    token: str | None = None,
    certificate: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None,
    key: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None,
    goal: Annotated[str | None, tyro.conf.arg(metavar="EXPRESSION")] = None,
    set: Annotated[tuple[str, ...], tyro.conf.arg(metavar="STATE=OBJECT[=VALUE] ...")] = (),
    pool: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="POOL.npz")] = None,
    worlds: int = 1,
    engine: str = "native",
    agent: str = "zero",
    robot: str | None = None,
    own: Own = NONE,
    seed: int = 0,
    object: AddedObjects = (),
    task: TaskOption = None,
    paused: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
    looks: str = "day",
) -> None:
    """Show a scene, an environment or a recording in the browser.

    Only this machine can open the page, unless --host and --token are given. Ctrl+C ends it.

    Args:
      what: folder of a converted scene, its scene.xml, or the name of a home that comes with ig2mj; or an environment
        (`ig2mj list-envs`, or FILE.py:NAME of yours); or a recording (`ig2mj rollout --record FILE`).
      port: port of the page; 0: any free port.
      host: additional address to listen on, e.g. 0.0.0.0; needs --token.
      token: secret that the page asks for, at least 16 letters and digits; auto: a random one.
      certificate: PEM file with your certificate, to serve the page by HTTPS.
      key: PEM file with the certificate's private key, if it is a separate file.
      goal: for a scene: expression to evaluate and explain, e.g. '(cooked fish_0)'.
      set: for a scene: set states first, e.g. toggled_on=stove_0 or temperature=fish_0=80.
      pool: for a scene: pool of start states (`ig2mj sample`).
      worlds: number of worlds; the page shows one of them.
      engine: native, warp or jax. Only on native can objects be dragged.
      agent: for an environment: zero (no motion), random, expert, planner (its plan and buttons for what it can do are
        in the panel), or a policy: a file written by `ig2mj train`, or the name of one that ships.
      robot: {robots}, or a folder that `ig2mj convert robot` wrote; default: for an environment the task's first, for a
        scene none. In a scene it plans.
      seed: for an environment: random seed of start states and actions.
      object: {object}.
      task: for a recording: its task, if it is defined in a file of yours; this imports the file.
      paused: start paused.
      looks: how the home is shown: day, night, or plain (without decoration).
    """
    import sys

    from ig2mj.install_hint import require_extras

    require_extras("web")
    from ig2mj.engine.registry import ENGINES
    from ig2mj.predicates.parse import parse
    from ig2mj.scene.scene import check_looks
    from ig2mj.web.access import access_for

    check_looks(looks)
    access = access_for(host, port, token, certificate, key)
    if worlds < 1:
        raise Ig2mjError(f"--worlds {worlds}: at least one is needed")
    if engine not in ENGINES:
        raise UnknownNameError("engine", engine, ENGINES)
    if goal is not None:
        parse(goal, "--goal")
    robot = choose_robot(robot, own)
    access.listen().close()  # a port that is taken is no news for after a minute of loading
    print(f"loading {what}; the address of the page follows", file=sys.stderr, flush=True)
    from ig2mj.web.viewer import WebViewer

    use_task(task)
    source = _source(what, goal, set, pool, worlds, engine, agent, robot, seed, object)
    with WebViewer(
        source, access, playing=not paused, title=f"ig2mj: {pathlib.Path(what).name}", looks=looks
    ) as viewer:
        print(viewer.url, flush=True)
        viewer.wait()


def _source(
    what: str,
    goal: str | None,
    set: tuple[str, ...],
    pool: pathlib.Path | None,
    worlds: int,
    engine: str,
    agent: str,
    robot: str | None,
    seed: int,
    objects: tuple[str, ...] = (),
) -> Source:
    from ig2mj.envs.registry import is_environment, list_envs
    from ig2mj.scene.paths import SHIPPED_HOMES, shipped_homes

    file = pathlib.Path(what)
    recorded = file.suffix.lower() in _RECORDINGS
    own = what.endswith(".py") or ".py:" in what  # a task of a file of the user's
    task = not recorded and (own or not file.exists()) and is_environment(what)
    if not (recorded or task or file.exists() or (SHIPPED_HOMES / what).is_dir()):
        raise UnknownNameError("scene, environment or recording", what, (*shipped_homes(), *list_envs()))
    if (recorded or task) and (goal is not None or set or pool is not None):
        raise Ig2mjError("--goal, --set and --pool are for a scene; tasks and recordings have their own")
    if not task and agent != "zero":
        raise Ig2mjError("--agent is for a task")
    if recorded and robot is not None:
        raise Ig2mjError("--robot is for a scene or a task: a recording has its own")
    if agent == PLANNER or (robot is not None and not task):
        if worlds > 1 or engine != "native" or set or pool is not None:
            raise Ig2mjError("a robot that plans is in one world of the native engine, without --set and --pool")
        return _planned(what, goal, robot or "humanoid", objects, seed)
    if objects and (recorded or pool is not None):
        raise Ig2mjError("--object is for a scene or a task: recordings and pools know their objects")
    if recorded:
        return _recording(file)
    if task:
        return _task(what, worlds, engine, agent, robot, seed, objects)
    return _home(what, goal, set, pool, worlds, engine, objects)


def _recording(file: pathlib.Path) -> Source:
    import sys

    from ig2mj.demos.reader import Recording
    from ig2mj.web.recorded import Recorded

    source = Recorded(Recording(file))
    for warning in source.warnings:
        print(f"warning: {warning}", file=sys.stderr)
    return source


def _task(
    name: str, worlds: int, engine: str, agent: str, robot: str | None, seed: int, objects: tuple[str, ...]
) -> Source:
    from ig2mj.cli.common.objects import note_changes
    from ig2mj.cli.common.tasks import ROWS, few_rows
    from ig2mj.cli.rollout import AGENTS, policy_named, who_acts
    from ig2mj.envs.registry import VECTORS, make
    from ig2mj.learn.policies import looks_of, objects_of
    from ig2mj.web.sources import Acting

    policy = None if agent in AGENTS else policy_named(agent)
    if policy is not None and not objects:
        objects = objects_of(policy, agent)
    seen = VECTORS if policy is None else policy.observations
    looks = None if policy is None else looks_of(policy)
    rows = few_rows(name, "train", max(ROWS, worlds), objects) or None
    env = make(name, robot, worlds, engine, observations=seen, objects=objects, looks=looks, pool_size=rows)
    note_changes(env.scene, objects)
    return Acting(env, who_acts(agent, policy, env, seed), seed)


PLANNER = "planner"
"""The agent that plans: its page has the plan, and buttons for primitives."""


def _planned(what: str, goal: str | None, robot: str, objects: tuple[str, ...], seed: int) -> Source:
    from ig2mj.cli.common.objects import note_changes
    from ig2mj.cli.common.planning import EMPTY
    from ig2mj.planning.problem import problem_of
    from ig2mj.tasks.own_goal import split_goal_name
    from ig2mj.web.planning import Planned

    home, own_goal = split_goal_name(what) or (what, goal)
    with_goal = own_goal is not None or not _is_scene(home)
    problem = problem_of(home, own_goal if with_goal else EMPTY, objects)
    note_changes(problem.scene, objects)
    return Planned(problem, robot, seed=seed, goal=with_goal)


def _is_scene(what: str) -> bool:
    from ig2mj.scene.paths import SHIPPED_HOMES

    return pathlib.Path(what).exists() or (SHIPPED_HOMES / what).is_dir()


def _home(
    name: str,
    goal: str | None,
    set: tuple[str, ...],
    pool: pathlib.Path | None,
    worlds: int,
    engine: str,
    objects: tuple[str, ...],
) -> Source:
    import jax
    import numpy as np

    from ig2mj.cli.common.objects import load_home
    from ig2mj.cli.common.worlds import started
    from ig2mj.engine.registry import make_engine
    from ig2mj.predicates import parse
    from ig2mj.web.sources import Home
    from ig2mj.worlds.core import Core
    from ig2mj.worlds.pool import load_pool, load_pool_scene
    from ig2mj.worlds.rules import Rules

    if pool is not None and set:
        raise Ig2mjError("--set cannot be combined with --pool")
    asked_goal = None if goal is None else parse(goal, "--goal")
    scene = load_home(name, objects) if pool is None else load_pool_scene(pool, name)
    rules = Rules.of_scene(scene)
    compiled = None if asked_goal is None else rules.compiled(asked_goal)
    core = Core(make_engine(engine, scene, worlds), rules, None if pool is None else load_pool(pool, scene))
    if not set:
        return Home(scene, core, compiled)
    one = started(pathlib.Path(name), "paper", 0.0, set, objects=scene.requested)
    states = jax.tree.map(lambda a: np.repeat(np.asarray(a), worlds, 0), one.states)
    return Home(scene, core, compiled, lambda core, batch: core.load(batch, one.engine.export(one.physics, 0), states))
