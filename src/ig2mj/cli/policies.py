"""`ig2mj policies`: the trained policies that ship with ig2mj."""

from __future__ import annotations

import pathlib
from typing import Annotated

import tyro


def list_(json: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False) -> int:
    """List the policies that ship, with their success on held-out start states.

    Args:
      json: print one JSON object.
    """
    from ig2mj.cli.common.printing import make_table, print_json, stdout_console
    from ig2mj.learn.policies import Policy
    from ig2mj.learn.shipped import shipped

    cards = {name: (Policy.load(file).card, file.stat().st_size) for name, file in shipped().items()}
    if json:
        print_json({name: {**card, "bytes": size} for name, (card, size) in cards.items()})
        return 0
    rows = []
    for name, (card, size) in cards.items():
        depends, found = card["depends"], card.get("evaluation", {})
        rate = f"{found['success_rate']:.1%} of {found['episodes']}" if found else "-"
        trained = f"{card.get('minutes', '-')} min, {card.get('device', '-')}"
        rows.append((name, depends["robot"], depends["grasping"], depends["mode"], rate, trained, f"{size / 1e6:.2f}"))
    if not rows:
        print("no policy ships with this version")
        return 0
    columns = ("policy", "robot", "grasping", "sees", "success, held out", "trained", "MB")
    stdout_console().print(make_table("policies", columns, rows))
    return 0


def show(name: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="POLICY")]) -> int:
    """Print a policy's model card.

    Args:
      name: name of a policy that ships, or a file written by `ig2mj train`.
    """
    from ig2mj.cli.common.printing import print_json
    from ig2mj.learn.policies import Policy
    from ig2mj.learn.shipped import find_policy, model_card

    file = find_policy(name)
    policy = Policy.load(file)
    if "evaluation" in policy.card:
        print(model_card(file.stem, policy), end="")
    else:
        print_json(policy.card)
    return 0


def add(
    run: Annotated[pathlib.Path, tyro.conf.Positional, tyro.conf.arg(metavar="RUN")],
    evaluation: pathlib.Path,
    name: str | None = None,
    folder: pathlib.Path | None = None,
) -> int:
    """Add a run's policy to those that ship, with its model card.

    Args:
      run: the run's folder, or its policy.npz.
      evaluation: output of `ig2mj evaluate RUN --episodes 1000 --json`.
      name: name of the policy; default: the task's, followed by robot, grasping and observation where they are
        unusual.
      folder: output folder; default: policies/ of this checkout.
    """
    from ig2mj.learn.shipped import CHECKOUT, add_policy

    file = add_policy(run, evaluation, name, folder or CHECKOUT)
    print(f"{file} ({file.stat().st_size / 1e6:.2f} MB) and {file.with_suffix('.md').name}")
    return 0


def serve(
    name: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="POLICY")],
    host: str = "127.0.0.1",
    port: int = 8000,
    stochastic: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
) -> int:
    """Answer observations with a policy's actions, by openpi's websocket protocol, until it is interrupted.

    There is no access control: who reaches the port can ask the policy.

    Args:
      name: name of a policy that ships, or a file written by `ig2mj train`.
      host: address to listen at; the default is reached from this machine alone.
      port: to listen at.
      stochastic: sample actions from the policy's distribution instead of taking its mode.
    """
    from ig2mj.envs.registry import make
    from ig2mj.errors import Ig2mjError
    from ig2mj.install_hint import require_extras
    from ig2mj.learn.policies import Policy, looks_of, objects_of, robot_of
    from ig2mj.learn.shipped import find_policy
    from ig2mj.serving.server import ServedPolicy
    from ig2mj.serving.server import serve as listen

    if not 0 < port < 65536:
        raise Ig2mjError(f"--port {port}: from 1 to 65535")
    require_extras("serve")
    file = find_policy(name)
    policy = Policy.load(file)
    depends = policy.card["depends"]
    made = {"observations": policy.observations, "relaxed_thresholds": policy.card.get("paper_rl", False)}
    made |= {"objects": objects_of(policy, file), "pool_size": 1, "looks": looks_of(policy)}
    env = make(depends["task"], robot_of(policy.card), 1, "native", depends["grasping"], **made)
    with listen(ServedPolicy(policy, env, file, stochastic or None), host, port) as server:
        print(f"serving {name} at ws://{host}:{port} (Ctrl-C ends it)", flush=True)
        try:
            server.serve_forever()
        except KeyboardInterrupt:
            print()
    return 0


SUBCOMMANDS = {"list": list_, "show": show, "add": add, "serve": serve}
