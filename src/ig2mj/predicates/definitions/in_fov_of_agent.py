"""InFoVOfAgent(o): at least one pixel of the agent's camera image shows o (table A.1).

Found without rendering: of points spread evenly over o's collision surface, one is in the view frustum, and the line of
sight to it enters no other object before (unless `StateOptions.occlusion` is off). An object of which less shows than
lies between sample points may be missed. Objects are opaque, also where their visual mesh is glass; the agent's own
body hides nothing.

Axes: W worlds, P objects, A agents, N sample points of an object, E pieces that may stand in the way.
"""

from __future__ import annotations

import functools

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.frustum import Camera, points_in_frustum
from ig2mj.geometry.poses import AnyArray, quat_rotate
from ig2mj.geometry.surface import object_surfaces, sample_surface
from ig2mj.geometry.targets import RayTargets, lines_enter_targets
from ig2mj.predicates.base import Arguments, Context, Predicate
from ig2mj.scene.tables import SceneTables

NUM_POINTS = 48
"""Sample points of an object."""

NEAR, FAR = 0.1, 100.0
"""Metres; iGibson's camera (iGibson's vision sensor)."""

BLOCKING = 0.999
"""Share of the way to a point within which something stands in front of it: a point on a surface does not hide itself
behind that surface by rounding."""

SIGHT_BUDGET = 2**24
"""Numbers that the lines of sight may fill at a time; more worlds are taken in turns."""


def _evaluate(context: Context, arguments: Arguments) -> Bool[Array, "W P"]:
    tables, objects = context.model.tables, arguments[:, 0]
    agents = np.flatnonzero(tables.agent_camera >= 0)
    if not np.any(tables.piece_object >= 0) or len(agents) == 0:
        return context.none(arguments)
    seen = functools.reduce(jnp.logical_or, [_seen(context, objects, int(agent)) for agent in agents])
    return seen & jnp.asarray(_surfaces(tables)[2])[objects]


def _seen(context: Context, objects: Int[AnyArray, "P"], agent: int) -> Bool[Array, "W P"]:
    """Whether one agent sees each object."""
    tables, view = context.model.tables, context.view
    points = _points(tables, view, objects)  # [W, P, N, 3]
    camera = Camera(
        pos=view.agent.eye_pos[:, agent],
        quat=view.agent.eye_quat[:, agent],
        fovy=float(tables.agent_fovy[agent]),
        aspect=context.model.options.image_aspect,
        near=NEAR,
        far=FAR,
    )
    flat = points.reshape(points.shape[0], -1, 3)
    in_view = points_in_frustum(camera, flat).reshape(points.shape[:-1])
    if not context.model.options.occlusion:
        return jnp.any(in_view, axis=-1)
    free = jax.lax.cond(
        jnp.any(in_view),
        lambda: ~_hidden(tables, view, objects, points, jnp.asarray(camera.pos)),
        lambda: jnp.zeros(in_view.shape, bool),
    )
    return jnp.any(in_view & free, axis=-1)


def _hidden(
    tables: SceneTables,
    view: PhysicsView,
    objects: Int[AnyArray, "P"],
    points: Float[Array, "W P N 3"],
    eye: Float[Array, "W 3"],
) -> Bool[Array, "W P N"]:
    """Whether another object stands in the way to each point."""
    others = np.unique(tables.piece_object[tables.piece_object >= 0])
    targets = RayTargets.build(tables, others)
    lines = points.shape[1] * points.shape[2]
    lengths = np.full(lines, BLOCKING, np.float32)

    def of_world(world: tuple[Array, Array, Array, Array]) -> Bool[Array, "P N O"]:
        body_pos, body_quat, at, start = world
        hit, _ = lines_enter_targets(
            targets,
            body_pos[None],
            body_quat[None],
            jnp.broadcast_to(start, (1, len(others), 3)),
            at.reshape(-1, 3) - start,
            lengths,
        )
        return jnp.swapaxes(hit[0], 0, 1).reshape(*at.shape[:2], len(others))

    worlds = (jnp.asarray(view.body_pos), jnp.asarray(view.body_quat), points, eye)
    at_once = max(1, SIGHT_BUDGET // (lines * max(len(tables.piece_object), 1)))
    blocked = jax.lax.map(of_world, worlds, batch_size=min(at_once, points.shape[0]))
    another = others != objects[:, None]
    return jnp.any(blocked & another[:, None], axis=-1)


def _points(tables: SceneTables, view: PhysicsView, objects: Int[AnyArray, "P"]) -> Float[Array, "W P N 3"]:
    """The objects' sample points, world frame."""
    body, local = (jnp.asarray(column)[objects] for column in _surfaces(tables)[:2])
    pos, quat = jnp.asarray(view.body_pos)[:, body], jnp.asarray(view.body_quat)[:, body]
    return pos + quat_rotate(quat, local)


@functools.lru_cache(maxsize=16)
def _surfaces(tables: SceneTables) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Bodies [O, N] and places [O, N, 3] of all objects' sample points, and whether an object has pieces at all [O]."""
    body, local = np.zeros((tables.num_objects, NUM_POINTS), int), np.zeros((tables.num_objects, NUM_POINTS, 3))
    having = np.isin(np.arange(tables.num_objects), tables.piece_object)
    with jax.ensure_compile_time_eval():  # constants: on the host, also while tracing
        for o in np.flatnonzero(having):
            body[o], local[o] = surface_points(tables, int(o))
    return body, local.astype(np.float32), having


@functools.lru_cache(maxsize=4096)
def surface_points(tables: SceneTables, obj: int) -> tuple[np.ndarray, np.ndarray]:
    """Bodies [N] and places [N, 3] in them of an object's sample points; the same for every call."""
    surfaces = object_surfaces(tables, obj)
    areas = [surface.area for surface in surfaces.values()]
    found_body, found_pos = [], []
    share = np.diff(np.round(NUM_POINTS * np.cumsum([0.0, *areas]) / sum(areas)).astype(int))
    rng = np.random.default_rng(obj)
    for (body, surface), count in zip(surfaces.items(), share, strict=True):
        found_pos.append(sample_surface(surface, int(count), rng).points)
        found_body.append(np.full(count, body))
    return np.concatenate(found_body), np.concatenate(found_pos).astype(np.float32)


IN_FOV_OF_AGENT = Predicate(
    name="in_fov_of_agent",
    arguments=("object",),
    evaluate=_evaluate,
    aliases=("in_fov_of_robot", "infovofagent", "infovofrobot"),
)
