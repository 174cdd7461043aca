"""Policies that ship with the project: found by name, and installed from runs with a model card.

They are in `policies/` of a checkout, and next to the installed package in a wheel. A policy's name is its task's; what
is not the task's usual robot, way of grasping or observation is added to it ("CookingMeat-fetch-state").
"""

from __future__ import annotations

import dataclasses
import json
import os
import pathlib
import shlex
from collections.abc import Mapping
from typing import Any

from ig2mj.envs.names import NAMESPACE, VERSION
from ig2mj.envs.registry import find_task
from ig2mj.errors import InputError, UnknownNameError
from ig2mj.learn.policies import Policy, looks_of
from ig2mj.learn.run_files import CHECKOUT, INSTALLED
from ig2mj.tasks.spots import home_and_place
from ig2mj.tasks.task import Task

MOST_BYTES, MOST_BYTES_OF_ALL = 700_000, 12_000_000
"""Sizes that a policy's file, and all of them together, may have."""

EPISODES = 1000
"""Held-out episodes that a model card is of, unless its author says why there are fewer."""


def shipped(folders: tuple[pathlib.Path, ...] = (CHECKOUT, INSTALLED)) -> dict[str, pathlib.Path]:
    """Files of the policies that ship, by name."""
    return {file.stem: file for folder in folders if folder.is_dir() for file in sorted(folder.glob("*.npz"))}


def find_policy(name: str | os.PathLike) -> pathlib.Path:
    """The file of a policy.

    Args:
      name: a file; the folder of a run; or the name of a policy that ships (`shipped`), which may be written as that of
        the environment is for Gymnasium: ig2mj/CookingMeat-v0.

    Raises:
      InputError: a path, and there is no such file. UnknownNameError: no policy has that name; with near matches.
    """
    file = pathlib.Path(name)
    if file.is_file():
        return file
    if file.is_dir() and (file / "policy.npz").is_file():
        return file / "policy.npz"
    known = shipped()
    short = str(name)
    if short.startswith(f"{NAMESPACE}/"):
        short = short.removeprefix(f"{NAMESPACE}/").removesuffix(f"-v{VERSION}")
    if short in known:
        return known[short]
    if file.is_dir():
        raise InputError(file, "holds no policy.npz", fix="`ig2mj train` writes one with every checkpoint")
    if file.suffix == ".npz" or len(pathlib.PurePath(short).parts) > 1:
        raise InputError(file, "there is no such file", fix="`ig2mj train` writes policies")
    raise UnknownNameError("policy", short, known)


def usual_name(policy: Policy) -> str:
    """The name under which a policy ships. Raises UnknownNameError: its task is none of ours."""
    depends = policy.card["depends"]
    task = find_task(depends["task"])
    parts = [task.name]
    parts += ["homes"] * ("homes" in policy.card)
    parts += [depends["robot"]] * (depends["robot"] != next(iter(task.robots)))
    parts += [depends["grasping"]] * (depends["grasping"] != task.grasping)
    parts += ["state"] * (isinstance(task, Task) and depends["mode"] == "state")
    return "-".join(parts)


def add_policy(
    run: str | os.PathLike,
    evaluation: str | os.PathLike,
    name: str | None = None,
    folder: pathlib.Path = CHECKOUT,
) -> pathlib.Path:
    """Makes a run's policy one that ships: its file with the evaluation in its card, and the card as a page.

    Args:
      run: a run's folder, or a policy's file. evaluation: what `ig2mj evaluate RUN --json` printed.
      name: None: `usual_name`. folder: where it goes.

    Returns:
      The policy's new file.

    Raises:
      InputError: the evaluation is of another policy or of states that were trained on, or a file becomes too large.
    """
    file = find_policy(run)
    policy = Policy.load(file)
    found = _read_evaluation(pathlib.Path(evaluation), policy)
    card = {**policy.card, "command": _without_paths(policy.card.get("command", "")), "evaluation": found}
    target = folder / f"{name or usual_name(policy)}.npz"
    if not folder.is_dir():
        raise InputError(folder, "there is no such folder", fix="policies are added in a checkout of the project")
    new_file = target.with_suffix(".new")
    ready = dataclasses.replace(policy, card=card)
    ready.save(new_file)
    size = new_file.stat().st_size
    others = sum(f.stat().st_size for f in folder.glob("*.npz") if f != target)
    for bytes_, most, what in (
        (size, MOST_BYTES, "a policy"),
        (size + others, MOST_BYTES_OF_ALL, "all policies together"),
    ):
        if bytes_ > most:
            new_file.unlink()
            fix = "train smaller networks: --set actor_layers=128,128"
            raise InputError(
                file, f"would make {bytes_ / 1e6:.2f} MB, and {what} may have {most / 1e6:.1f} MB", fix=fix
            )
    new_file.replace(target)
    target.with_suffix(".md").write_text(model_card(target.stem, ready), encoding="utf-8")
    return target


EVALUATED = ("episodes", "success_rate", "success_low", "success_high", "mean_return", "engine", "drawn")


def _read_evaluation(file: pathlib.Path, policy: Policy) -> dict[str, Any]:
    """What of an evaluation goes into the card."""
    fix = "`ig2mj evaluate RUN --episodes 1000 --json > FILE` writes one"
    try:
        lines = [line for line in file.read_text(encoding="utf-8").splitlines() if line.strip()]
        found = json.loads(lines[-1])
        missing = [n for n in ("weights", "split", *EVALUATED) if n not in found]
    except (OSError, ValueError, IndexError, TypeError) as e:
        raise InputError(file, f"is not an evaluation ({type(e).__name__})", fix=fix) from e
    if missing:
        raise InputError(file, "is missing", element=missing[0], fix=fix)
    if found["weights"] != policy.weights_digest:
        raise InputError(file, "is the evaluation of another policy", element="weights", fix=fix)
    if found["split"] != "held_out":
        raise InputError(file, f"is of the split {found['split']}, not of held-out states", element="split", fix=fix)
    return {name: found[name] for name in (*EVALUATED, "start_states") if name in found}


def _without_paths(command: str) -> str:
    """A command without the folder that a run was written to, and without the folders of its files."""
    words, kept = shlex.split(command), []
    while words:
        word = words.pop(0)
        if word in ("--out", "--resume"):
            words = words[1:] if word == "--out" else words
            continue
        kept.append(pathlib.PurePath(word).name if word.startswith(("/", "~", ".")) else word)
    return shlex.join(kept)


def _varied(randomize: str) -> str:
    """Axes of a run's `randomize` for people, with the settings that are not the usual ones."""
    if not randomize.startswith("{"):
        return randomize.replace(",", ", ")
    words = list[str]()
    for axis, settings in json.loads(randomize).items():
        own = settings.items() if isinstance(settings, dict) else ()
        numbers = ", ".join(f"{k} {' to '.join(map(str, v)) if isinstance(v, list) else v}" for k, v in own)
        words += [f"{axis} ({numbers})" if numbers else axis] * bool(settings)
    return ", ".join(words)


def model_card(name: str, policy: Policy) -> str:
    """A page in Markdown: what a policy is for, how it was made, how good it is, and what it does not do."""
    card: Mapping[str, Any] = policy.card
    depends, found = card["depends"], card["evaluation"]
    sees = ", ".join(policy.observations)
    if depends["picture"]:
        sees += f"; images averaged down to {depends['picture'][0]}x{depends['picture'][1]}"
        sees += f", looks `{looks_of(policy)}`"
    rate = (
        f"{found['success_rate']:.1%} of {found['episodes']:,} held-out episodes, each from another start state "
        f"({found['success_low']:.1%} to {found['success_high']:.1%} with 95 % confidence)"
    )
    thresholds = "the paper's runs'" if card.get("paper_rl") else "the rules'"
    helped = "the task's scripted expert" if card.get("expert") or card.get("algorithm") == "dagger" else None
    rows = {
        "task": depends["task"],
        "robot, grasping": f"{depends['robot']}, {depends['grasping']}",
        "sees": sees,
        "acts by": ", ".join(depends["actions"]),
        "success": rate,
        "thresholds": thresholds,
        "start states": found.get("start_states"),
        "mean return": f"{found['mean_return']:.3f}",
        "evaluated on": f"the {found['engine']} engine, {'sampled' if found['drawn'] else 'deterministic'} actions",
        "command": f"`{card.get('command', '')}`",
        "algorithm": card.get("algorithm"),
        "help": helped or ("demonstrations" if card.get("demonstration_steps") else "none"),
        "seed": card.get("seed"),
        "minutes of training": card.get("minutes"),
        "seconds of compilation before": None if card.get("compile_s") is None else round(card["compile_s"]),
        "environment steps": f"{card['env_steps']:,}" if card.get("env_steps") else None,
        "device": card.get("device"),
        "homes of training": ", ".join(card["homes"]) if "homes" in card else None,
        "differs between its episodes": _varied(card.get("run_settings", {}).get("randomize", "")) or None,
        "scene": None if "homes" in card else card.get("scene"),
        "weights": policy.weights_digest,
    }
    lines = [f"# {name}", "", "| | |", "|---|---|"]
    lines += [f"| {key} | {value} |" for key, value in rows.items() if value is not None]
    number = len({home_and_place(home)[0] for home in card.get("homes", ())})
    where = "trained and evaluated in one simulated home"
    if number:
        where = f"trained in {number} simulated homes and evaluated in the task's own"
    limits = (
        "It is for this task, robot, way of grasping and observation alone, and refused for others. "
        f"It was {where}, with the same objects at other places; it has not been tried on a real robot."
    )
    commands = [f"    ig2mj evaluate {name}" + " --stochastic" * found["drawn"], f"    ig2mj view --policy {name}"]
    if any((folder / f"{name}.toml").is_file() for folder in (CHECKOUT, INSTALLED)):
        commands.append(f"    ig2mj train --config {name}")
    return "\n".join([*lines, "", *commands, "", limits, ""])
