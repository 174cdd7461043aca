"""What a policy's file must be before anything is made of it: its card, its arrays, and how they fit together."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Annotated, Any, Literal

import jax
import jax.numpy as jnp
import msgspec
import numpy as np

from ig2mj.envs.names import refuse_path
from ig2mj.errors import Ig2mjError, InputError
from ig2mj.files.npz import refuse_nonfinite
from ig2mj.learn.occlusion.object_memory import POSE

Count = Annotated[int, msgspec.Meta(ge=0, le=100_000)]
Width = Annotated[int, msgspec.Meta(ge=1, le=100_000)]
Name = Annotated[str, msgspec.Meta(max_length=1000)]

_FIX = "`ig2mj train` writes policies"

REMOVED = ("paper", "places")
"""Encoders of version 0.1 that no policy that ships uses."""


class _Depends(msgspec.Struct):
    task: Name
    robot: Name
    grasping: Name
    actions: Annotated[list[Name | int], msgspec.Meta(min_length=1, max_length=10_000)]
    mode: Name
    vector: dict[Name, Width]
    picture: tuple[Width, Width, Width] | None
    privileged: list[Name]
    rows: tuple[Count, Count] | None = None
    depth_range: Annotated[float, msgspec.Meta(gt=0, le=1e6)] | None = None
    looks: Literal["day", "night", "plain"] | None = None
    task_file: Name | None = None
    task_code: Name | None = None


class _Memory(msgspec.Struct):
    poses: list[Count]
    grips: list[Count]
    hands: list[Count] = []
    places: list[tuple[Count, Count, Count]] = []
    whole: bool = True


class _Net(msgspec.Struct):
    net: Name
    sizes: Annotated[list[Width], msgspec.Meta(max_length=100)]
    guess: Count = 0
    choices: Count = 0
    objects: Count = 0
    recall: _Memory | None = None


class _Card(msgspec.Struct):
    depends: _Depends
    net: _Net
    digest: Name = ""


def check_card(card: Mapping[str, Any], file: object) -> None:
    """Raises InputError where a card does not say what a policy is for and what its network is."""
    try:
        known = msgspec.convert(card, _Card)
    except (msgspec.ValidationError, RecursionError) as e:
        raise InputError(file, str(e), element="card.json", fix=_FIX) from e
    refuse_path(known.depends.task, file, "card.json: depends.task")
    if known.net.net in REMOVED or (known.net.net == "glimpses" and not known.net.objects):
        words = f"its encoder '{known.net.net}' is no longer supported"
        raise InputError(file, words, element="card.json: net", fix="ig2mj 0.1.0 reads it")
    memory = known.net.recall
    if memory is None:
        return
    width, guess = sum(known.depends.vector.values()), known.net.guess
    fits = all(k < guess for k in memory.poses) and all(k < width for k in (*memory.grips, *memory.hands))
    if memory.hands:
        fits &= len(memory.hands) == len(memory.grips) and POSE * len(memory.places) == len(memory.poses)
        fits &= all(k + 6 <= width for k in memory.hands)
    if not fits:
        raise InputError(file, "what it remembers does not fit together", element="card.json: net.recall", fix=_FIX)


def check_arrays(arrays: Mapping[str, np.ndarray], file: object) -> None:
    """Raises InputError where an array is not of finite floating-point numbers."""
    for name, array in arrays.items():
        if array.dtype.kind != "f":
            raise InputError(file, f"is of type {array.dtype}, not of floating-point numbers", element=name, fix=_FIX)
        refuse_nonfinite(array, file, name, _FIX)


def check_scales(mean: np.ndarray, deviation: np.ndarray, file: object, element: str) -> None:
    """Raises InputError where deviations [x] are not as many as means [x], or not positive."""
    if mean.ndim != 1 or mean.shape != deviation.shape or (deviation <= 0).any():
        raise InputError(file, "must be as long as its mean, and positive", element=element, fix=_FIX)


def check_play(play: Callable[..., Any], parameters: Any, vector: int, picture: int, kept: int, file: object) -> None:
    """Traces one step of a policy and raises InputError where its arrays do not fit its card.

    Args:
      play: from a vector [1, x], a image [1, q] of bytes, what is remembered [1, m], whether an episode begins [1],
        and `parameters`. vector, picture, kept: x, q, m. file: the policy's, for the message.
    """
    rows = (((1, vector), jnp.float32), ((1, picture), jnp.uint8), ((1, kept), jnp.float32), ((1,), jnp.bool_))
    try:
        jax.eval_shape(play, *(jax.ShapeDtypeStruct(*row) for row in rows), parameters)
    except Ig2mjError:
        raise
    except Exception as e:  # flax has a type for each way in which weights do not fit, JAX and jaxtyping further ones
        said = next(iter(str(e).splitlines()), type(e).__name__)[:200]
        raise InputError(file, f"its arrays do not fit its card: {said}", fix=_FIX) from e
