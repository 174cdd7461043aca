"""`ig2mj evaluate` on episode files: a policy of ours, or a policy server."""

from __future__ import annotations

import dataclasses
import pathlib
from typing import Any

import jax

from ig2mj.agents.registry import find_robot
from ig2mj.cli.common.axes import Output, check_episodes, chosen_episodes, play_axes
from ig2mj.cli.common.files import check_output
from ig2mj.envs.environment import Environment
from ig2mj.envs.registry import find_task
from ig2mj.envs.rollout import Act
from ig2mj.errors import EngineError, Ig2mjError
from ig2mj.learn.episodes import NOMINAL, Episodes

NATIVE_WORLDS, SERVER_WORLDS = 8, 8
"""Worlds unless another number is asked for: of the native engine, and of servers that answer one at a time."""


@dataclasses.dataclass(frozen=True)
class Request:
    """Options of `ig2mj evaluate` that all kinds of agents have."""

    axes: str | None
    episodes: int | None
    file: pathlib.Path | None
    page: pathlib.Path | None
    out: pathlib.Path | None
    json: bool
    engine: str | None
    worlds: int
    robot: str | None
    grasping: str | None
    resume: bool = False

    def check(self) -> None:
        """Raises Ig2mjError: a number or a file is none."""
        if self.episodes is not None and self.episodes < 1:
            raise Ig2mjError(f"--episodes {self.episodes}: at least one episode")
        if self.worlds < 0:
            raise Ig2mjError(f"--worlds {self.worlds}: at least one world, or 0 for the usual number")
        if self.resume and self.out is None:
            raise Ig2mjError("--resume needs --out FILE: what is finished is stored next to it")
        for file in (self.out, self.page):
            if file is not None:
                check_output(file)

    def make_options(self, count: int, usual: int) -> dict[str, Any]:
        """Engine and worlds of `ig2mj.make`. `usual`: most worlds unless another number is asked for."""
        engine = self.engine or ("warp" if jax.default_backend() == "gpu" else "native")
        most = min(usual, NATIVE_WORLDS) if engine == "native" else usual
        return {"engine": engine, "worlds": self.worlds or min(count, most)}


def _check_grasping(episodes: Episodes, grasping: str) -> None:
    made = episodes.header["grasping"]
    if grasping != made and "physical" in (grasping, made):
        task = episodes.header["task"]
        fix = f"`ig2mj episodes make {task} --grasping {grasping} --out FILE`, then --episode-file FILE"
        raise EngineError(f"the episodes are of grasping '{made}', not '{grasping}' ({fix})")


def evaluate_policy(name: str, request: Request, stochastic: bool) -> int:
    """A policy of ours on `request.axes`. Returns the exit status."""
    from ig2mj.learn.evaluate import acting
    from ig2mj.learn.policies import Policy, doors_in, horizon_on_card, looks_of, objects_of, robot_of
    from ig2mj.learn.shipped import find_policy

    request.check()
    file = find_policy(name)
    policy = Policy.load(file)
    depends = policy.card["depends"]
    episodes = chosen_episodes(depends["task"], request.file)
    axes, count = check_episodes(NOMINAL if request.axes is None else request.axes, request.episodes, episodes)
    _check_grasping(episodes, request.grasping or depends["grasping"])
    options = {
        **request.make_options(count, 1000),
        "robot": request.robot or robot_of(policy.card),
        "grasping": request.grasping or depends["grasping"],
        "observations": policy.observations,
        "relaxed_thresholds": policy.card.get("paper_rl", False),
        "looks": looks_of(policy),
        "objects": objects_of(policy, file),
        **doors_in(depends),
        **horizon_on_card(policy.card),
    }

    def act_of(env: Environment) -> Act:
        return acting(policy, env, file, drawn=stochastic or None)

    about = {"env": depends["task"], "robot": depends["robot"], "agent": name, "weights": policy.weights_digest}
    about |= {"engine": options["engine"], "worlds": options["worlds"], "drawn": stochastic}
    return _play(f"{name} on episodes of {depends['task']}", episodes, axes, count, act_of, options, request, about)


def evaluate_server(
    task: str, address: str, request: Request, observations: str | None, size: int, chunk: int, timeout: float
) -> int:
    """A policy server on `request.axes`, by default the nominal episodes. Returns the exit status."""
    from ig2mj.serving.client import connect
    from ig2mj.serving.remote_actor import RemoteActor

    request.check()
    if not 0 < timeout < float("inf"):
        raise Ig2mjError(f"--timeout {timeout:g}: a number of seconds above 0")
    if chunk < 0:
        raise Ig2mjError(f"--chunk {chunk}: at least one step, or 0 for all that the server sends")
    if size < 1:
        raise Ig2mjError(f"--image-size {size}: at least one pixel")
    known = find_task(task)
    episodes = chosen_episodes(known.name, request.file)
    axes, count = check_episodes(NOMINAL if request.axes is None else request.axes, request.episodes, episodes)
    server = connect(address, request.worlds or SERVER_WORLDS, timeout)
    try:
        says = server.metadata
        options = _options_of(known, says, request, observations, size)
        _check_grasping(episodes, options["grasping"])
        usual = 1000 if says.get("batch") is True else SERVER_WORLDS
        options |= request.make_options(count, usual)

        def act_of(env: Environment) -> Act:
            return RemoteActor(env, server, chunk)

        about = {"env": known.name, "robot": str(options["robot"]), "agent": address}
        about |= {"engine": options["engine"], "worlds": options["worlds"], "chunk": chunk}
        return _play(f"{address} on {known.name}", episodes, axes, count, act_of, options, request, about)
    finally:
        server.close()


def _options_of(
    task: Any, says: dict[str, Any], request: Request, observations: str | None, size: int
) -> dict[str, Any]:
    """Of `ig2mj.make`, from what a server says of itself and what is asked for."""
    ours = says.get("server") == "ig2mj"
    if ours and says.get("task") != task.name:
        raise EngineError(f"the server's policy is for {says.get('task')!s}, not for {task.name} (name that task)")
    made_for = str(says.get("robot")) if ours and "robot" in says else None
    if made_for and request.robot and request.robot != made_for:
        raise EngineError(
            f"the server's policy is for robot '{made_for}', not for '{request.robot}' (leave out --robot)"
        )
    robot = request.robot or (says.get("robot") if ours else None) or next(iter(task.robots))
    grasping = request.grasping or (says.get("grasping") if ours else None) or task.grasping
    options: dict[str, Any] = {"robot": robot, "grasping": grasping}
    if observations is not None:
        options["observations"] = tuple(name.strip() for name in observations.split(",") if name.strip())
    elif ours and isinstance(says.get("observations"), list):
        options["observations"] = tuple(str(name) for name in says["observations"])
        options["relaxed_thresholds"] = says.get("relaxed_thresholds") is True
    else:
        hand = bool(find_robot(robot)[1].hand_count)
        options["observations"] = ("proprioception", "rgb", *(("right_wrist/rgb",) * hand))
    if not ours:
        options["image_size"] = size
    return options


def _play(
    title: str,
    episodes: Episodes,
    axes: tuple[str, ...],
    count: int,
    act_of: Any,
    options: dict[str, Any],
    request: Request,
    about: dict[str, Any],
) -> int:
    output = Output(request.json, request.out, request.page, request.resume)
    return play_axes(title, episodes, axes, count, act_of, options, output, about)
