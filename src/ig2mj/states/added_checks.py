"""`AddedUpdates`: what updates of plug-ins' states read and change, found by tracing them once for a scene.

Faults are found before the first step. What is read decides how much of a step the native engine may skip
(`ig2mj.worlds.incremental`).

Axes: W worlds, O objects, S heat sources.
"""

from __future__ import annotations

import functools
import hashlib
import re
import typing
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ig2mj.engine.view import SCHEMA, assemble, axis_sizes
from ig2mj.errors import PluginError
from ig2mj.process.gc_pause import GC_PAUSED
from ig2mj.process.tracing import inputs_that_matter
from ig2mj.states.definitions import sliced
from ig2mj.states.initial import initial_states
from ig2mj.states.model import StateModel
from ig2mj.states.relations.plan import RelationPlan
from ig2mj.states.spec import EventStep, HeatStep, StateSpec
from ig2mj.states.update import HEAT, heat_fields, queries

SCENES = 8
"""Scenes whose findings are kept."""

WORLDS = 2
"""W of the traced arrays: a mistaken shape [O] does not pass for [1, O]."""

OWN_LATE = frozenset(name for spec in HEAT for name in spec.fields)
"""Fields of ig2mj's own states of the second part, which change in most steps."""

OWN = ("states", "drops", "cut_now", "swap")
"""What an update may change of a step."""


class AddedUpdates(NamedTuple):
    """What the updates of plug-ins' states read and change, all together.

    Attributes:
      reads: paths of the fields of the view (`ig2mj.engine.view.SCHEMA`). acts: names of states that change more than
        their own fields. whole: one of them reads or changes what only a whole step brings up to date.
      late: fields of the second part that ones of the first read: a whole step follows where these have changed.
      heat_reads_view: one of the second part reads the view.
      digest: hash of what all of them compute, as this version of JAX writes it; "" where there are none.
    """

    reads: frozenset[str] = frozenset()
    acts: tuple[str, ...] = ()
    whole: bool = False
    late: frozenset[str] = frozenset()
    heat_reads_view: bool = False
    digest: str = ""

    @staticmethod
    @functools.lru_cache(maxsize=SCENES)
    def of(model: StateModel) -> AddedUpdates:
        """Those of a scene.

        Raises:
          PluginError: an update fails, or gives another step, field, shape or dtype than it got; or a field starts with
            another shape than one world has.
        """
        updated = [spec for spec in model.added if spec.update is not None]
        for spec in model.added:
            _check_start(model, spec)
        if not updated:
            return AddedUpdates()
        found = [_traced(model, spec) for spec in updated]
        late, acting, whole, heat_reads_view, read_late = set(heat_fields(model)), [], False, False, set[str]()
        for spec, one in zip(updated, found, strict=True):
            if not one.changes <= set(spec.fields):
                acting.append(spec.name)
            if spec.part == "events":
                read_late |= late & one.states
            else:
                whole |= not one.changes <= late
                heat_reads_view |= bool(one.view)
        whole |= not read_late.isdisjoint(OWN_LATE)
        reads = frozenset[str]().union(*(one.view for one in found))
        digest = hashlib.blake2b("".join(one.text for one in found).encode(), digest_size=16).hexdigest()
        return AddedUpdates(reads, tuple(acting), whole, frozenset(read_late), heat_reads_view, digest)


class _Traced(NamedTuple):
    """One update.

    Attributes:
      view, states: fields that it reads. changes: fields of states, and parts of the step. text: what it computes.
    """

    view: frozenset[str]
    states: frozenset[str]
    changes: frozenset[str]
    text: str


def _check_start(model: StateModel, spec: StateSpec) -> None:
    if spec.initial is None:
        return
    started = spec.initial(model)
    if set(started) != set(spec.fields):
        raise PluginError(
            f"state '{spec.name}' has fields {sorted(spec.fields)}, and its initial gives {sorted(started)}"
        )
    for name, values in started.items():
        kinds = typing.get_args(spec.fields[name]) or (spec.fields[name],)
        if not any(isinstance(values, kind) for kind in kinds):
            what = f"its initial gives '{name}' as {type(values).__name__} {getattr(values, 'dtype', '')}"
            raise PluginError(f"state '{spec.name}': {what}, which is not of the field's {spec.fields[name]}")
        for leaf in jax.tree.leaves(values):
            if np.ndim(leaf) == 0 or len(leaf) != 1:
                what = f"its initial gives '{name}' of shape {np.shape(leaf)}"
                raise PluginError(f"state '{spec.name}': {what}; the first axis is that of worlds, and is 1")


def _traced(model: StateModel, spec: StateSpec) -> _Traced:
    states = initial_states(model, 1)
    paths, structure = jax.tree_util.tree_flatten_with_path(states)
    names = [path[0].name for path, _ in paths]
    sizes = axis_sizes(model.tables, WORLDS)
    view = {name: jax.ShapeDtypeStruct(field.shape(sizes), field.dtype) for name, field in SCHEMA.items()}
    leaves = [jax.ShapeDtypeStruct((WORLDS, *leaf.shape[1:]), leaf.dtype) for _, leaf in paths]
    changes: set[str] = set()

    def whole(leaves: list[Any], fields: dict[str, Any]) -> list[Any]:
        step = _step(model, spec, jax.tree.unflatten(structure, leaves), fields)
        changed = _changed(spec, step, _called(spec, step))
        changes.update(name for name, _ in changed)
        return [leaf for _, new in changed for leaf in jax.tree.leaves(new)]

    try:
        with GC_PAUSED:
            traced = jax.make_jaxpr(whole)(leaves, view)
    except PluginError as e:
        e.__notes__ = []  # JAX's, about its traceback
        raise
    used = inputs_that_matter(traced.jaxpr)
    # A dict's leaves are in the order of its sorted keys.
    reads = {name for name, u in zip(sorted(view), used[len(leaves) :], strict=True) if u}
    own = {name for name, u in zip(names, used[: len(leaves)], strict=True) if u}
    constants = [hashlib.blake2b(np.asarray(c).tobytes(), digest_size=16).hexdigest() for c in traced.consts]
    text = f"{spec.name} {spec.part} {re.sub('0x[0-9a-f]+', '', str(traced.jaxpr))} {constants}"
    return _Traced(frozenset(reads), frozenset(own), frozenset(changes), text)


def _step(model: StateModel, spec: StateSpec, states: Any, fields: dict[str, Any]) -> EventStep | HeatStep:
    view = assemble(fields)
    if spec.part == "heat":
        acts = jnp.zeros((WORLDS, model.tables.num_objects, len(model.parameters.heat_object)), bool)
        return HeatStep(model, states, acts, view, sliced.in_use(model, states.sliced))
    return EventStep.start(model, states, view, RelationPlan.build(model, queries(model)).evaluate(view))


def _called(spec: StateSpec, step: EventStep | HeatStep) -> EventStep | HeatStep:
    update: Callable[[Any], Any] | None = spec.update
    assert update is not None
    try:
        made = update(step)
    except Exception as e:
        why = " ".join(f"{type(e).__name__}: {e}".split())
        raise PluginError(f"the update of state '{spec.name}' (part '{spec.part}') fails: {why:.300}") from e
    if type(made) is not type(step):
        requested = type(step).__name__
        raise PluginError(
            f"the update of state '{spec.name}' gives {made!r:.80}; {requested} is expected (step.having(...))"
        )
    return made


def _changed(spec: StateSpec, step: Any, made: Any) -> list[tuple[str, Any]]:
    """Fields of states and parts of the step that are other arrays now. Raises PluginError: of another form."""
    pairs = [(n, getattr(step.states, n), getattr(made.states, n)) for n in step.states.__dataclass_fields__]
    pairs += [(n, getattr(step, n), getattr(made, n)) for n in OWN[1:] if hasattr(step, n)]
    changed = []
    for name, before, after in pairs:
        olds, structure = jax.tree.flatten(before)
        news, found = jax.tree.flatten(after)
        if len(olds) == len(news) and all(map(_is, olds, news)):
            continue
        requested, given = [_form(leaf) for leaf in olds], [_form(leaf) for leaf in news]
        if structure != found or requested != given:
            raise PluginError(
                f"the update of state '{spec.name}' gives '{name}' as {', '.join(given) or 'nothing'}; "
                f"{', '.join(requested)} is expected (W is {WORLDS} here)"
            )
        changed.append((name, after))
    return changed


def _is(one: Any, other: Any) -> bool:
    return one is other


def _form(leaf: Any) -> str:
    """Type and shape, for messages."""
    return f"{jnp.result_type(leaf)}{list(jnp.shape(leaf))}"
