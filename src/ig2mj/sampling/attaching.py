"""Attaching an object to another: where it is put, and the constraint that holds it there."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

from ig2mj.engine.base import Write
from ig2mj.engine.model_fields import ModelFields
from ig2mj.engine.writes import teleports
from ig2mj.errors import StateError
from ig2mj.sampling.query import SceneQuery
from ig2mj.sampling.surface_particles import sample_places
from ig2mj.scene.extras import attached_as_text, joint_name
from ig2mj.states.definitions import attached
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates

TRIES = 12
"""Points of the surface that are tried."""

STEPS = (0.002, 0.0, -0.002, -0.005, -0.01, -0.02)
"""m between the box of the object and the point, tried in turn until the two touch."""

DEEPEST = 0.004
"""m by which it may stand in something."""


def number_of(model: StateModel, child: str, parent: str) -> int:
    """The pair of two objects. Raises StateError: the scene has no such pair."""
    names = model.tables.object_names
    joints = model.joints
    number = None if joints is None else joints.number_of(names.index(child), names.index(parent))
    if number is None:
        raise StateError(f"'{child}' cannot be attached to '{parent}': add '{attached_as_text(child, parent)}'")
    return number


def attach(
    query: SceneQuery,
    model: StateModel,
    states: ExtendedStates,
    number: int,
    value: bool,
    rng: np.random.Generator,
) -> ExtendedStates | None:
    """Attaches a pair in the query's world, or detaches it; the states after that, None: no place was found.

    An object that touches the other one already is attached where it is.
    """
    joints = attached.of(model)
    child, parent = int(joints.child[number]), int(joints.parent[number])
    if not value:
        states = attached.set_attached(model, states, number, False, query.view)
        _switch(query, model, states)
        return states
    before = query.save()
    touching = bool(np.asarray(query.view.touching)[0, child, parent]) and _is_there(joints, query, number)
    for _ in range(TRIES):
        if touching or (_put_against(query, model, number, rng) and _is_there(joints, query, number)):
            made = attached.set_attached(model, states, number, True, query.view)
            _switch(query, model, made)
            settled = query.settle()
            far = float(np.asarray(attached.stretched(joints, jnp.asarray(made.joint_place), query.view))[0, number])
            if settled and far < attached.APART:
                return made
        touching = False
        query.load(before)
    return None


def _is_there(joints: attached.Joints, query: SceneQuery, number: int) -> bool:
    return bool(np.asarray(attached.at_place(joints, query.view))[0, number])


def _put_against(query: SceneQuery, model: StateModel, number: int, rng: np.random.Generator) -> bool:
    """Puts an object against a point of another's surface, that at the pair's place if it has one, turned as it is;
    whether they touch there."""
    view, joints = query.view, attached.of(model)
    child, parent = int(joints.child[number]), int(joints.parent[number])
    places = sample_places(model.tables, view, parent, rng)
    valid = np.flatnonzero(np.asarray(places.valid).reshape(-1))
    if not len(valid):
        return False
    bodies = np.asarray(places.body).reshape(-1)[valid]
    points, normals = (np.asarray(f).reshape(-1, 3)[valid] for f in (places.pos, places.normal))
    turns = [_matrix(np.asarray(view.body_quat)[0, body]) for body in bodies]
    points = np.array([np.asarray(view.body_pos)[0, b] + t @ p for b, t, p in zip(bodies, turns, points, strict=True)])
    place = np.asarray(attached.places(joints, view))[0, number]
    if np.isnan(place[0]):
        n = int(rng.integers(len(valid)))
        point = points[n]
    else:
        n, point = int(np.linalg.norm(points - place, axis=1).argmin()), place
    normal = turns[n] @ normals[n]
    low, high = np.asarray(view.aabb_low)[0, child], np.asarray(view.aabb_high)[0, child]
    reach = float(np.abs(normal) @ (high - low) / 2)
    offset = np.asarray(view.object_pos)[0, child] - (low + high) / 2
    quat = np.asarray(view.object_quat)[0, child]
    for step in STEPS:
        pos = point + normal * (reach + step) + offset
        query.write(teleports(model.tables.num_objects, child, pos, quat))
        if query.penetration(child) > DEEPEST:
            return False
        if bool(np.asarray(query.view.touching)[0, child, parent]):
            return True
    return False


def _switch(query: SceneQuery, model: StateModel, states: ExtendedStates) -> None:
    """Switches the constraints of all pairs in the query's world."""
    joints, names, mj = attached.of(model), model.tables.object_names, query.scene.model
    now = query.engine.snapshot(query.physics)
    active, data = np.array(now.whole("eq_active")), np.array(now.whole("eq_data"), np.float32)
    active, data = active.reshape(1, -1), data.reshape(1, -1, data.shape[-1])
    for number, (child, parent) in enumerate(zip(joints.child, joints.parent, strict=True)):
        row = mj.equality(joint_name(names[child], names[parent])).id
        active[0, row] = bool(np.asarray(states.attached)[0, number])
        data[0, row, :10] = np.asarray(states.joint_place)[0, number]
    query.write(Write(eq_active=active, model_fields=ModelFields(eq_data=data)))


def _matrix(quat: np.ndarray) -> np.ndarray:
    w, x, y, z = quat
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
