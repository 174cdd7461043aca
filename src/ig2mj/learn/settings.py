"""Settings by name, as `--set name=value` and a file of settings give them.

Names of version 0.1 keep working until version 0.3: `RENAMED` says what each is called now.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import sys
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, TypeVar

from ig2mj.errors import Ig2mjError, UnknownNameError
from ig2mj.process.deprecation import rename_text, warn_renamed

Config = TypeVar("Config")

COUNTS = (
    *("rollout_length", "utd_ratio", "batch_size", "buffer_size", "n_step", "num_atoms", "policy_delay"),
    *("max_noise_repeat", "epochs", "minibatches", "num_updates", "image_size", "programs"),
)
"""Settings of which there is at least one, in whichever algorithm they are."""

SHARES = ("gamma", "gae_lambda", "tau", "expert_decay", "bc_decay", "beta_decay", "random_actions", "q_filter")
"""Settings from 0 to 1."""

RENAMED: dict[str, tuple[str, ...]] = {
    "length": ("rollout_length",),
    "updates": ("utd_ratio",),
    "batch": ("batch_size",),
    "capacity": ("buffer_size",),
    "warm_up": ("warm_up_steps",),
    "refill": ("refill_steps",),
    "horizon": ("n_step",),
    "atoms": ("num_atoms",),
    "largest": ("v_max",),
    "every": ("policy_delay",),
    "alpha": ("init_alpha",),
    "std": ("target_std",),
    "held": ("max_noise_repeat",),
    "head_start": ("critic_head_start",),
    "guided": ("expert_decay",),
    "reach": ("expert_steps",),
    "disturbance": ("expert_noise",),
    "copy": ("bc_coef",),
    "copied": ("bc_decay",),
    "trust": ("q_filter",),
    "guess": ("aux_coef",),
    "shift": ("image_shift",),
    "last_lr": ("final_lr",),
    "actor": ("actor_layers",),
    "critic": ("critic_layers",),
    "net": ("encoder",),
    "parts": ("minibatches",),
    "smooth": ("gae_lambda",),
    "clip": ("clip_ratio",),
    "value": ("value_coef",),
    "entropy": ("entropy_coef",),
    "steps": ("num_updates",),
    "noise": ("action_noise", "input_noise"),
    "choices": ("action_bins",),
    "alone": ("beta_decay",),
    "disturbed": ("random_actions",),
    "told": ("imageless_batch",),
    "average": ("average_updates",),
    "starts": ("pretrain_images",),
    "look": ("pretrain_updates",),
    "opening": ("pretrain_expert_steps",),
    "recall": ("object_memory",),
    "believed": ("belief_labels",),
    "until": ("stop_at_success",),
    "paper_rl": ("relaxed_thresholds",),
    "mixed": ("augment_starts",),
    "pixels": ("image_size",),
    "rows": ("image_rows",),
}
"""Name of version 0.1 -> what it is called now; the first that the settings at hand have."""

_VALUES = {"object_memory": {"0": "none", "1": "poses", "2": "full"}}
"""Values of version 0.1 that are called otherwise now."""


def old_names_work(config: type[Config]) -> type[Config]:
    """Lets a class of settings be made with the names of version 0.1, with a FutureWarning."""
    make = config.__init__
    known = {f.name for f in dataclasses.fields(config)}  # pyright: ignore[reportArgumentType]

    @functools.wraps(make)
    def init(self: Any, *values: Any, **named: Any) -> None:
        new = dict[str, Any]()
        for name, value in named.items():
            now = name if name in known else _new_name(name, known)
            if now != name:
                warn_renamed(name, now, config.__name__)
            new[now] = value
        make(self, *values, **new)

    config.__init__ = init  # pyright: ignore[reportAttributeAccessIssue]
    return config


def _new_name(name: str, known: Mapping[str, Any] | set[str]) -> str:
    return next((new for new in RENAMED.get(name, ()) if new in known), name)


def configured(config: Config, changes: Sequence[str]) -> Config:
    """A dataclass with some of its fields changed; see `configure_all`."""
    return configure_all((config,), changes)[0]


def configure_all(
    configs: Sequence[Any],
    changes: Sequence[str],
    elsewhere: Mapping[str, str] = MappingProxyType({}),
    quiet: bool = False,
) -> list[Any]:
    """Dataclasses with some of their fields changed.

    Args:
      changes: "name=value"; the layers of a network as "256,256". A name of version 0.1 prints one line on stderr.
      elsewhere: names of other settings, and what to say of each where it is given.
      quiet: nothing is printed, since an earlier call with the same changes has.

    Raises:
      UnknownNameError: no such setting, with near matches. Ig2mjError: no value of its type, or one that cannot be:
        negative, not finite, none of what is counted, a share above 1.
    """
    fields = {f.name: getattr(c, f.name) for c in configs for f in dataclasses.fields(c)}
    new: dict[str, Any] = {}
    for change in changes:
        name, sign, text = change.partition("=")
        if not sign:
            raise Ig2mjError(f"--set {change}: a setting is name=value")
        if name not in fields and (now := _new_name(name, fields)) != name:
            if not quiet:
                print(f"setting {rename_text(name, now)}", file=sys.stderr)
            name, text = now, _VALUES.get(now, {}).get(text, text)
        if name not in fields:
            if (now := _new_name(name, elsewhere)) in elsewhere:
                was = "" if now == name else f"'{name}' is now '{now}'; "
                raise Ig2mjError(f"--set {name}: {was}{elsewhere[now]}")
            raise UnknownNameError("setting", name, fields)
        new[name] = _value(name, text, fields[name])
        _check(name, new[name])
    return [
        dataclasses.replace(c, **{n: v for n, v in new.items() if n in {f.name for f in dataclasses.fields(c)}})
        for c in configs
    ]


def _value(name: str, text: str, old: Any) -> Any:
    try:
        if isinstance(old, bool):
            return {"true": True, "1": True, "false": False, "0": False}[text.lower()]
        if isinstance(old, tuple):
            return tuple(int(part) for part in text.replace(":", ",").split(",") if part)
        if isinstance(old, str):
            return text
        return type(old)(text)
    except (ValueError, KeyError):
        kind = "numbers with commas" if isinstance(old, tuple) else f"of type {type(old).__name__}"
        raise Ig2mjError(f"--set {name}={text}: the value is {kind}, as in {name}={written(old)}") from None


def _check(name: str, value: Any) -> None:
    if isinstance(value, str | bool):
        return
    least, most = (1 if name in COUNTS or isinstance(value, tuple) else 0), (1 if name in SHARES else math.inf)
    for number in value if isinstance(value, tuple) else (value,):
        if not (least <= number <= most and math.isfinite(number)):
            upwards = f"at least {least}" if most == math.inf else f"from {least} to {most}"
            raise Ig2mjError(f"--set {name}={written(value)}: {name} is {upwards}, and finite")


def written(value: Any) -> str:
    """A value as `configured` reads it."""
    if isinstance(value, bool):
        return str(value).lower()
    return ",".join(map(str, value)) if isinstance(value, tuple | list) else str(value)
