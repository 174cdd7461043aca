"""Policies as files: an actor's weights in half precision, and a card that says what it is for.

A file is an npz archive: one array for each weight, the mean and deviation of what the actor sees, and the card as
JSON. A policy belongs to a task, a robot, a way of grasping, the names of the actions and the observations; with
others it is refused, and the message names what differs. The package version is not checked.

Axes: W worlds, n numbers of an action.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
import os
import pathlib
from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ig2mj.agents.registry import ROBOTS, is_robot_folder
from ig2mj.engine.view import Array
from ig2mj.errors import Ig2mjError, InputError, PolicyMismatch
from ig2mj.files.content import decode_json
from ig2mj.files.npz import read_npz, write_npz
from ig2mj.files.unfinished import replacing
from ig2mj.learn.action_distributions import mode, sample
from ig2mj.learn.checkpoints import refuse_difference
from ig2mj.learn.networks import ActorNetwork, apply_with_memory, conv_encoder
from ig2mj.learn.occlusion import glimpses
from ig2mj.learn.occlusion.object_memory import ObjectMemory
from ig2mj.learn.perception import DEPTH_RANGE, SIZE, Perception
from ig2mj.learn.policy_checks import check_arrays, check_card, check_play, check_scales
from ig2mj.learn.running_stats import RunningStats
from ig2mj.process import entry_point
from ig2mj.scene.changes import added
from ig2mj.scene.found_again import entries_of, requests_again
from ig2mj.scene.scene import PLAIN
from ig2mj.tasks.added_objects import object_texts
from ig2mj.tasks.custom.code import IN_FILES

FORMAT_VERSION = 1

CARD = "card.json"

PREDICTION_LAYERS = "guess/"
"""Begins the names of the layers that predict; they are in a file only where the actor acts on the prediction."""

HIDDEN = ("hidden_mean", "hidden_deviation")
"""Names in a file of the scales of the privileged numbers that are predicted."""


def world_of(env: Any) -> dict[str, Any]:
    """What an environment is, apart from what is seen of it, for JSON. Entries that it lacks are left out."""
    code = getattr(getattr(env, "task", None), "code", None)
    return ({} if code is None else code.in_files) | {
        "task": getattr(getattr(env, "task", None), "name", type(env).__name__),
        "robot": getattr(env, "robot", ""),
        "grasping": getattr(env, "grasping", ""),
        "actions": list(getattr(env, "action_names", range(env.action_space.shape[0]))),
        "privileged": list(getattr(env, "privileged_names", ())),
        **looks_in(env.observation_spaces, getattr(getattr(env, "sensor_options", None), "looks", PLAIN)),
        **doors_in({"doors": getattr(getattr(env, "config", None), "doors", "shut")}),
    }


def doors_in(made_with: Mapping[str, Any]) -> dict[str, str]:
    """What `world_of` says of the doors between rooms: nothing where they are shut at the start of episodes."""
    return {"doors": "open"} if made_with.get("doors") == "open" else {}


def horizon_on_card(found: Mapping[str, Any]) -> dict[str, int]:
    """What a policy's card, or a recording's header, says of episodes: their agent steps, of which `time_left` is
    observed as a share; nothing where it does not say so."""
    horizon = found.get("horizon")
    return {"horizon": int(horizon)} if isinstance(horizon, int | np.integer) and horizon > 0 else {}


def looks_in(spaces: Mapping[str, Any], looks: str) -> dict[str, str]:
    """What `world_of` says of how cameras see the home: nothing where observations are no images, or it is plain."""
    return {"looks": looks} if {"rgb", "depth"} & set(spaces) and looks != PLAIN else {}


def looks_of(policy: Policy) -> str | None:
    """How an environment's cameras must see the home for a policy (`ig2mj.make(looks=...)`); None: it sees no images.

    A card that does not say so is of a policy that was trained on plain homes.
    """
    depends = policy.card["depends"]
    return depends.get("looks", PLAIN) if depends["picture"] else None


def objects_on_card(env: Any) -> dict[str, Any]:
    """Of an environment with objects added to its home (`EnvConfig.objects`) what a policy's card says of them."""
    config = getattr(env, "config", None)
    if config is None or not config.objects:
        return {}
    requested = list(object_texts(config.objects))
    additions = env.scene.additions
    own = additions[len(additions) - len(added(requested)) :]
    return {"objects": requested, "objects_found_by": entries_of((*env.scene.replacements, *own))}


def objects_of(policy: Policy, file: object) -> tuple[str, ...]:
    """What was added to the home where a policy was trained, for `ig2mj.make(objects=...)`, where it is now.

    Raises:
      InputError: it is missing; names `file`.
    """
    requested = policy.card.get("objects", [])
    return requests_again(requested, policy.card.get("objects_found_by", []), str(file)) if requested else ()


def depends_of(world: Mapping[str, Any], perception: Perception) -> dict[str, Any]:
    """What a policy depends on, for JSON: the environment (`world_of`), and what the actor sees of it."""
    sizes = dict(zip(perception.vector_names, perception.sizes, strict=True))
    sees_all = perception.actor_size == perception.vector_size
    seen = perception.vector_names if sees_all else perception.vector_names[:-1]
    found = {name: world[name] for name in ("task", "robot", "grasping", "actions")}
    found |= {name: world[name] for name in IN_FILES if name in world}
    found["mode"] = perception.mode
    found["vector"] = {name: sizes[name] for name in seen}
    shape = perception.image_shape
    found["picture"] = shape and list(shape)
    if shape and shape[0] < shape[1]:
        found["rows"] = list(perception.rows)
    if shape and perception.depth_range != DEPTH_RANGE:
        found["depth_range"] = perception.depth_range
    if shape and world.get("looks", PLAIN) != PLAIN:
        found["looks"] = world["looks"]
    found |= doors_in(world)
    found["privileged"] = list(world["privileged"]) if perception.mode == "state" else []
    return found


def perception_of(policy: Policy, spaces: Mapping[str, Any]) -> Perception:
    """How a policy sees an environment's observations: as in its training."""
    depends = policy.card["depends"]
    size, rows = depends["picture"][1] if depends["picture"] else SIZE, depends.get("rows")
    depth_range = depends.get("depth_range", DEPTH_RANGE)
    return Perception(spaces, depends["mode"], size, (rows[0], rows[1]) if rows else None, depth_range=depth_range)


def depends_on(env: Any, perception: Perception) -> dict[str, Any]:
    """What a policy for this environment depends on."""
    return depends_of(world_of(env), perception)


def robot_folder(made_with: Any) -> dict[str, str]:
    """What a card keeps of the robot that an environment was made with: the folder of one of the user's own."""
    return {"robot_folder": made_with} if isinstance(made_with, str) and is_robot_folder(made_with) else {}


def robot_of(card: Mapping[str, Any]) -> str:
    """The robot that a policy is for, as `ig2mj.make` takes it: a name, or the folder of the user's own robot.

    A folder that is not where it was when the policy was trained leaves the name, which `make` refuses.
    """
    name, folder = card["depends"]["robot"], card.get("robot_folder")
    if name in ROBOTS or not isinstance(folder, str) or not is_robot_folder(folder):
        return name
    return folder


def digest(depends: Mapping[str, Any]) -> str:
    """Of what a policy depends on: 12 hexadecimal digits."""
    return hashlib.blake2b(json.dumps(depends, sort_keys=True).encode(), digest_size=6).hexdigest()


@entry_point
@dataclasses.dataclass(frozen=True)
class Policy:
    """A trained actor.

    Attributes:
      card: "depends", "digest", "net", and how it was made ("command", "seed", "minutes", "device", "success", ...).
      weights: by the path of the layer. mean, deviation: of what the actor sees. hidden: those of what it predicts;
        None where it does not. file: where it was read from, for messages.
    """

    card: dict[str, Any]
    weights: dict[str, Float[np.ndarray, "..."]]
    mean: Float[np.ndarray, "x"]
    deviation: Float[np.ndarray, "x"]
    hidden: tuple[Float[np.ndarray, "h"], Float[np.ndarray, "h"]] | None = None
    file: object = "the policy"

    @classmethod
    def of(cls, algorithm: Any, learner: Any, depends: Mapping[str, Any], made: Mapping[str, Any]) -> Policy:
        """The actor of an algorithm.

        Args:
          depends: see `depends_on`. made: for the card.
        """
        config, size = algorithm.config, algorithm.perception.actor_size
        actor, memory = algorithm.actor, getattr(algorithm, "memory", None)
        net: dict[str, Any] = {"net": config.encoder, "sizes": list(config.actor_layers)}
        net |= actor.encoder.card() if actor.encoder is not None else {}
        weights = {k: np.asarray(v) for k, v in flat(learner.actor).items()}
        if not actor.acts_on_prediction:
            weights = {k: w for k, w in weights.items() if not k.startswith(PREDICTION_LAYERS)}
        if actor.bins:
            net["choices"] = actor.bins
        if memory is not None:
            net["recall"] = memory.card()
        own = dict(depends)
        card = {"format": FORMAT_VERSION, "depends": own, "digest": digest(own), "net": net, **made}
        moments: RunningStats = jax.device_get(learner.moments)
        mean, deviation = (np.asarray(a) for a in moments.scales(len(moments.mean)))
        hidden = (mean[size:], deviation[size:]) if actor.acts_on_prediction else None
        return cls(card, weights, mean[:size], deviation[:size], hidden)

    def save(self, file: str | os.PathLike) -> None:
        """Writes it. Raises OSError."""
        half = {f"weights/{name}": np.asarray(w, np.float16) for name, w in self.weights.items()}
        path = pathlib.Path(file)
        with replacing(path) as part, part.open("wb") as f:
            card = np.frombuffer(json.dumps(self.card).encode(), np.uint8)
            scales = {"mean": self.mean, "deviation": self.deviation}
            if self.hidden is not None:
                scales |= dict(zip(HIDDEN, self.hidden, strict=True))
            write_npz(f, {CARD: card, **scales, **half})

    @classmethod
    def load(cls, file: str | os.PathLike) -> Policy:
        """Reads it. Raises InputError."""
        fix = "`ig2mj train` writes policies"
        arrays = read_npz(file, fix=fix)
        raw = arrays.pop(CARD, np.zeros(0))
        if raw.dtype != np.uint8:
            raise InputError(file, "is missing", element=CARD, fix=fix)
        card = decode_json(raw.tobytes(), file, kind=dict, fix=fix)
        if card.get("format") != FORMAT_VERSION:
            raise InputError(file, f"has format {card.get('format')}, and {FORMAT_VERSION} is what can be read")
        check_card(card, file)
        check_arrays(arrays, file)
        try:
            weights = {name[8:]: a.astype(np.float32) for name, a in arrays.items() if name.startswith("weights/")}
            nested(weights)
            mean, deviation = arrays["mean"], arrays["deviation"]
            hidden = (arrays[HIDDEN[0]], arrays[HIDDEN[1]]) if HIDDEN[0] in arrays else None
        except (KeyError, TypeError, AttributeError) as e:  # missing, or a weight inside another one
            raise InputError(file, f"is missing, or not an array: {e}", fix=fix) from e
        check_scales(mean, deviation, file, "deviation")
        if hidden is not None:
            check_scales(*hidden, file, HIDDEN[1])
        return cls(card, weights, mean, deviation, hidden, file)

    @property
    def observations(self) -> tuple[str, ...]:
        """What an environment must observe for it (`ig2mj.make`)."""
        depends = self.card["depends"]
        return (*depends["vector"], *(("rgb", "depth") if depends["mode"] == "rgbd" else ()))

    def check(self, env: Any, perception: Perception, file: object = "the policy") -> None:
        """Raises PolicyMismatch where the policy is for something else, with the pair that differs."""
        own, here = self.card["depends"], depends_on(env, perception)
        if own["picture"]:
            own, here = {"looks": PLAIN, **own}, {"looks": PLAIN, **here}
        refuse_difference(file, own, here, PolicyMismatch)

    @property
    def weights_digest(self) -> str:
        """Of the weights as they are in the file: 16 hexadecimal digits."""
        mark = hashlib.blake2b(digest_size=8)
        for name in sorted(self.weights):
            mark.update(name.encode() + np.asarray(self.weights[name], np.float16).tobytes())
        mark.update(np.asarray(self.mean, np.float32).tobytes() + np.asarray(self.deviation, np.float32).tobytes())
        return mark.hexdigest()

    @property
    def memory(self) -> ObjectMemory | None:
        """What it remembers; None: nothing."""
        card = self.card["net"].get("recall")
        return None if card is None else ObjectMemory.of(card, len(self.mean))

    def actor(self, perception: Perception, *, sampled: bool = False) -> Any:
        """A pure function from observations by name to actions [W, n], of a policy that remembers nothing.

        Args:
          sampled: actions are sampled from the policy's distribution, and the function takes a key, too; else they are
            its mode.

        Raises:
          Ig2mjError: it remembers something.
        """
        if self.memory is not None:
            words = "this policy has a memory: its actions do not follow from the observation alone (Policy.player)"
            raise Ig2mjError(words)
        play = self.player(perception, sampled=sampled)

        def act(obs: Mapping[str, Array], key: Array | None = None) -> Array:
            worlds = next(iter(obs.values())).shape[0]
            return play(obs, jnp.zeros((worlds, 0)), jnp.zeros(worlds, bool), key)[0]

        return act

    def player(self, perception: Perception, *, sampled: bool = False) -> Any:
        """A pure function from observations by name, what is remembered [W, m], in which worlds an episode begins [W],
        and a key where actions are `sampled`, to actions [W, n] and what is remembered from then on. m is 0 without a
        `memory`.

        It also takes `parameters` instead of the policy's own: as constants they would make another program of each
        policy."""
        depends, net, memory = self.card["depends"], self.card["net"], self.memory
        shape = depends["picture"] and tuple(depends["picture"])
        glimpsing = shape and net["net"] == glimpses.NAME
        encoder = glimpses.encoder_from_card(net, shape) if glimpsing else conv_encoder(shape, net["net"])
        network = ActorNetwork(len(depends["actions"]), tuple(net["sizes"]), encoder, net.get("choices", 0))
        size, mine = perception.actor_size, self.parameters()

        def heads(vector: Array, image: Array, kept: Array, begins: Array, parameters: Any) -> Any:
            params, *scales = parameters

            def apply(*given: Any) -> Any:
                return network.apply({"params": params}, *given)

            return apply_with_memory(apply, memory, (scales[0], scales[1]), vector, image, kept, begins)

        pixels, remembered = math.prod(shape) if shape else 0, 0 if memory is None else memory.size
        check_play(heads, mine, size, pixels, remembered, self.file)

        def play(
            obs: Mapping[str, Array], kept: Array, begins: Array, key: Array | None = None, parameters: Any = mine
        ) -> tuple[Array, Array]:
            seen = perception(obs)
            (head, log_std, _), kept = heads(seen.vector[:, :size], seen.image, kept, begins, parameters)
            if not sampled:
                return mode(head), kept
            assert key is not None, "a sampled action needs a key"
            return sample(head, log_std, key), kept

        return play

    def parameters(self) -> tuple[Any, Array, Array]:
        """What was learned, as arrays of JAX: weights, and mean and deviation of what the network sees and predicts."""
        hidden = self.hidden or (np.zeros(0, np.float32), np.zeros(0, np.float32))
        scales = (np.concatenate(pair) for pair in zip((self.mean, self.deviation), hidden, strict=True))
        return jax.tree.map(jnp.asarray, (nested(self.weights), *scales))


def flat(tree: Mapping[str, Any], before: str = "") -> dict[str, Any]:
    """The leaves of nested dictionaries, by their paths."""
    found = {}
    for name, value in tree.items():
        found |= flat(value, f"{before}{name}/") if isinstance(value, Mapping) else {f"{before}{name}": value}
    return found


def nested(leaves: Mapping[str, Any]) -> dict[str, Any]:
    """Nested dictionaries of leaves by path: the inverse of `flat`."""
    tree: dict[str, Any] = {}
    for path, value in leaves.items():
        *folders, name = path.split("/")
        place = tree
        for folder in folders:
            place = place.setdefault(folder, {})
        place[name] = value
    return tree
