"""Queries of the host: one compiled program for each predicate of a scene, in which the arguments are data.

A goal of a batch is one fused program (`CompiledExpression.status`), compiled for its objects, which makes the fastest
step. A host that asks about one object after another would compile such a program each time. Here a predicate is
compiled once for a scene and a number of worlds, at its first query; each further pair is a call. Both evaluate
`Predicate.evaluate`.

Axes: W worlds, N rows of arguments, K arguments of a predicate, I facts.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import jaxpr_as_fun
from jaxtyping import Bool, Int

from ig2mj.engine.view import SCHEMA, Array, PhysicsView, assemble, axis_sizes, read_field
from ig2mj.predicates.base import Context, Predicate
from ig2mj.predicates.literals import Literals
from ig2mj.predicates.registry import find
from ig2mj.process.gc_pause import GC_PAUSED
from ig2mj.process.tracing import inputs_that_matter
from ig2mj.states.initial import initial_states
from ig2mj.states.model import StateModel
from ig2mj.states.relations.relations import Pairs, Relations
from ig2mj.states.relations.traced import PieceTables, TracedRelations
from ig2mj.states.world import ExtendedStates

ROWS = 64
"""Rows of arguments in one call; only rows in use cost time."""

COMPILED_FAST: dict[str, int | bool] = {"xla_backend_optimization_level": 0}
"""XLA's options on a CPU: compiled in 40 % of the time; a call takes tenths of a millisecond either way."""
if jax.__version_info__ < (0, 11):  # later versions lack the first
    # One part, not 32 with a copy each of all that is declared: 13 % less, on the wall of two cores, too.
    COMPILED_FAST |= {"xla_cpu_use_fusion_emitters": False, "xla_cpu_parallel_codegen_split_count": 1}

SCENES = 8
"""Scenes whose programs are kept: those used last."""

VIEW, STATES = "view.", "states."


class HostQueries:
    """All predicates of a scene, each compiled at its first query."""

    def __init__(self, model: StateModel, num_worlds: int = 1):
        self.model, self.num_worlds = model, num_worlds
        self._tables = PieceTables(model)
        self._programs: dict[str, _Program] = {}

    @staticmethod
    @functools.lru_cache(maxsize=SCENES)
    def of(model: StateModel) -> HostQueries:
        """Those of a single world of a scene; the same object each time, for the last few scenes."""
        return HostQueries(model)

    def facts(self, literals: Literals, states: ExtendedStates, view: PhysicsView) -> Bool[np.ndarray, "W I"]:
        """As `Literals.facts`: truth of every instance, and at the end one that is false."""
        found = [self.holds(find(name), rows, states, view) for name, rows in literals.instances.items()]
        return np.concatenate([*found, np.zeros((self.num_worlds, 1), bool)], axis=-1)

    def holds(
        self, predicate: Predicate, rows: Sequence[tuple[int, ...]], states: ExtendedStates, view: PhysicsView
    ) -> Bool[np.ndarray, "W N"]:
        """Truth of a predicate for rows of argument indices."""
        program = self._program(predicate)
        inputs = [_read(name, states, view) for name in program.reads]
        parts = [np.array(rows[i : i + ROWS], np.int32) for i in range(0, len(rows), ROWS)]
        return np.concatenate([program(inputs, part) for part in parts], axis=-1)

    def reads(self, predicate: Predicate) -> tuple[str, ...]:
        """Paths of all arrays that the predicate's truth may depend on: "states.temperature", "view.touching", ..."""
        return self._program(predicate).reads

    def relations(self, states: ExtendedStates, view: PhysicsView) -> HostRelations:
        """Relations of pairs in these worlds, each computed when it is asked for."""
        return HostRelations(self, states, view)

    def _program(self, predicate: Predicate) -> _Program:
        if predicate.name not in self._programs:
            self._programs[predicate.name] = _Program(predicate, self._tables, self.num_worlds)
        return self._programs[predicate.name]


class HostRelations(Relations):
    """Relations of any pairs; a relation is a query as a predicate is."""

    def __init__(self, queries: HostQueries, states: ExtendedStates, view: PhysicsView):
        self._ask = functools.partial(queries.holds, states=states, view=view)

    def answer(self, relation: str, pairs: Pairs) -> Bool[np.ndarray, "W P"]:
        """See `Relations.answer`."""
        return self._ask(_relation(relation), [tuple(int(i) for i in pair) for pair in pairs])


@functools.cache
def _relation(name: str) -> Predicate:
    return Predicate(
        name=f"relation {name}",
        arguments=("object", "object"),
        evaluate=lambda context, pairs: context.relations.answer(name, pairs),
    )


class _Program:
    """One predicate; `reads` are found by tracing it."""

    def __init__(self, predicate: Predicate, tables: PieceTables, num_worlds: int):
        self._predicate, self._tables = predicate, tables
        template = initial_states(tables.model, num_worlds)
        paths, self._structure = jax.tree_util.tree_flatten_with_path(template)
        named = {STATES + ".".join(key.name for key in path): leaf for path, leaf in paths}
        self._states = tuple(named)
        shapes = {name: jax.ShapeDtypeStruct(leaf.shape, leaf.dtype) for name, leaf in named.items()}
        sizes = axis_sizes(tables.model.tables, num_worlds)
        for name, field in SCHEMA.items():
            shapes[VIEW + name] = jax.ShapeDtypeStruct(field.shape(sizes), field.dtype)
        self._shapes = shapes
        rows = jax.ShapeDtypeStruct((ROWS, len(predicate.arguments)), np.int32)
        count = jax.ShapeDtypeStruct((), np.int32)
        with GC_PAUSED:
            traced = jax.make_jaxpr(self._everything)(list(shapes.values()), rows, count)
        matters = inputs_that_matter(traced.jaxpr)
        self.reads = tuple(name for name, used in zip(shapes, matters, strict=False) if used)
        taken = [i for i, used in enumerate(matters[: len(shapes)]) if used]
        run = functools.partial(_run, traced, taken, list(shapes.values()))
        self._call = jax.jit(run, compiler_options=COMPILED_FAST if jax.default_backend() == "cpu" else None)

    def __call__(self, inputs: list[Array], rows: Int[np.ndarray, "N K"]) -> Bool[np.ndarray, "W N"]:
        padded = np.zeros((ROWS, rows.shape[1]), np.int32)
        padded[: len(rows)] = rows
        with GC_PAUSED:  # the first call compiles
            return np.asarray(self._call(inputs, padded, np.int32(len(rows))))[:, : len(rows)]

    def _everything(self, leaves: list[Array], rows: Int[Array, "N K"], count: Int[Array, ""]) -> Bool[Array, "W N"]:
        """Truth of the first `count` rows; the other answers are false."""
        named = dict(zip(self._shapes, leaves, strict=True))
        states = jax.tree.unflatten(self._structure, [named[name] for name in self._states])
        view = assemble({name: named[VIEW + name] for name in SCHEMA})
        context = Context(self._tables.model, states, view, TracedRelations(self._tables, view))

        def answer(i: Int[Array, ""], found: Bool[Array, "W N"]) -> Bool[Array, "W N"]:
            row = jax.lax.dynamic_slice_in_dim(rows, i, 1)
            return jax.lax.dynamic_update_slice_in_dim(found, self._predicate.evaluate(context, row), i, 1)

        return jax.lax.fori_loop(0, count, answer, jnp.zeros((view.object_com.shape[0], len(rows)), bool))


def _run(traced, taken: list[int], shapes: list[jax.ShapeDtypeStruct], inputs: list[Array], rows: Array, count: Array):
    """A traced program from the inputs that matter alone."""
    every: list = [np.zeros(s.shape, s.dtype) for s in shapes]
    for i, leaf in zip(taken, inputs, strict=True):
        every[i] = leaf
    return jaxpr_as_fun(traced)(*every, rows, count)[0]


def _read(name: str, states: ExtendedStates, view: PhysicsView) -> Array:
    if name.startswith(VIEW):
        return read_field(view, name.removeprefix(VIEW))
    return functools.reduce(getattr, name.removeprefix(STATES).split("."), states)
