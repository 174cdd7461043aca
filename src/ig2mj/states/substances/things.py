"""Objects that transition rules use up or make: which exist, which is in which container, where they come and go.

What does not exist is parked on a slab outside the house (`ig2mj.scene.parking`).

Axes: W worlds, O objects, X objects that can come and go, C containers, G kinds of objects that rules name, U
substances, Q rules in use.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.poses import quat_rotate, quat_rotate_inverse
from ig2mj.knowledge.transitions import COOKED, DICED, MELTED, Transition, stands_for
from ig2mj.scene.manifest import InsideEntry
from ig2mj.scene.parking import changing, places
from ig2mj.scene.tables import SceneTables
from ig2mj.states.spec import Saved, StateSpec, given_from_outside, nothing_inherited

if TYPE_CHECKING:
    from ig2mj.states.model import StateModel
    from ig2mj.states.world import ExtendedStates

NEAR = 0.02
"""m by which an object's centre may be beyond the box of a container's inside."""

HEAP = 0.08
"""m above the opening up to which an object's centre counts as in the container: a heap."""

DROP = 0.06
"""m above the opening at which a rule's first object appears; each other one is `APART` higher."""

APART = 0.06


@dataclasses.dataclass(frozen=True, eq=False)
class Things:
    """The objects of a scene that rules use up or make.

    Attributes:
      object: the X axis. litres: volume of its collision pieces.
        park: where its main body is while it does not exist, m, turned by nothing.
      kinds: the G axis. member: which objects are of each kind. needs: how many of each kind each rule uses up.
        makes: kind that each rule makes, -1: none. count: how many.
      melts, dices, dices_cooked: substance that each object becomes where it is warm, or under a blade; -1: none.
      melting_point: Celsius. low, high: box of the inside of each container, m, frame of its main body.
    """

    object: Int[np.ndarray, "X"]
    litres: Float[np.ndarray, "X"]
    park: Float[np.ndarray, "X 3"]
    kinds: tuple[str, ...]
    member: Bool[np.ndarray, "G X"]
    needs: Int[np.ndarray, "Q G"]
    makes: Int[np.ndarray, "Q"]
    count: Int[np.ndarray, "Q"]
    melts: Int[np.ndarray, "X"]
    dices: Int[np.ndarray, "X"]
    dices_cooked: Int[np.ndarray, "X"]
    melting_point: float
    low: Float[np.ndarray, "C 3"]
    high: Float[np.ndarray, "C 3"]

    @classmethod
    def build(
        cls,
        tables: SceneTables,
        rules: Sequence[Transition],
        names: Sequence[str],
        insides: Mapping[int, InsideEntry],
    ) -> tuple[Things, tuple[Transition, ...]]:
        """Those of a scene, and the rules of containers, which are the Q axis.

        Args:
          rules: all in use. names: of the substances. insides: of the containers, by object.
        """
        categories = tables.object_categories
        objects = changing(rules, categories, tables.object_fixed.tolist())
        of_containers = tuple(rule for rule in rules if not rule.of_single_objects)
        kinds = tuple(
            dict.fromkeys(
                [
                    *(kind for rule in of_containers for kind, _ in rule.objects),
                    *(rule.output for rule in of_containers if rule.count),
                ]
            )
        )
        own = [categories[o] for o in objects]
        boxes = [(np.min(i.vertices, axis=0), np.max(i.vertices, axis=0)) for i in insides.values()]
        ground = [_ground(tables, o) for o in objects]
        wholes = [bool(np.any(tables.object_part_of == o)) for o in objects]
        return cls(
            object=np.array(objects, int),
            litres=np.array([1000.0 * _hull_volume(tables, o) for o in objects], np.float32),
            park=(places(len(objects)) + np.array([[0.0, 0.0, g] for g in ground]).reshape(-1, 3)).astype(np.float32),
            kinds=kinds,
            member=np.array([[stands_for(k, c) for c in own] for k in kinds], bool).reshape(len(kinds), len(objects)),
            needs=np.array([[dict(r.objects).get(k, 0) for k in kinds] for r in of_containers], int).reshape(
                len(of_containers), len(kinds)
            ),
            makes=np.array([kinds.index(r.output) if r.count else -1 for r in of_containers], int),
            count=np.array([r.count for r in of_containers], int),
            melts=_becomes(MELTED, own, names, [False] * len(own)),
            dices=_becomes(DICED, own, names, wholes),
            melting_point=max((r.temperature for r in rules if r.of_single_objects and not r.cut), default=0.0),
            dices_cooked=_becomes(COOKED + DICED, own, names, wholes),
            low=np.array([b[0] for b in boxes], np.float32).reshape(-1, 3),
            high=np.array([b[1] for b in boxes], np.float32).reshape(-1, 3),
        ), of_containers


def _becomes(prefix: str, categories: Sequence[str], names: Sequence[str], never: Sequence[bool]) -> np.ndarray:
    """Of each object the first substance with a prefix that is of its kind; -1: none. `never`: give way to halves."""
    found = np.full(len(categories), -1)
    for x, category in enumerate(categories):
        for number, name in enumerate(names):
            if name.startswith(prefix) and stands_for(name.removeprefix(prefix), category) and not never[x]:
                found[x] = number
                break
    return found


def _hull_volume(tables: SceneTables, obj: int) -> float:
    """m^3 of the convex pieces of an object."""
    import scipy.spatial  # takes as long as all of this package

    volume = 0.0
    for piece in np.flatnonzero(tables.piece_object == obj):
        try:
            volume += scipy.spatial.ConvexHull(tables.piece_vertices[piece]).volume
        except scipy.spatial.QhullError:
            continue
    return volume


def _ground(tables: SceneTables, obj: int) -> float:
    """m from the lowest point of an object, turned by nothing, up to the origin of its main body."""
    mine = (tables.piece_object == obj) & (tables.piece_body == tables.object_root[obj])
    if not mine.any():
        return 0.1
    corners = tables.piece_pos[mine][:, None] + np.asarray(
        quat_rotate(tables.piece_quat[mine][:, None], tables.piece_vertices[mine])
    )
    return float(-corners[..., 2].min()) + 0.001


def of(model: StateModel) -> Things:
    """Those of a scene with substances."""
    assert model.substances is not None
    return model.substances.things


def absent(model: StateModel, states: ExtendedStates) -> Bool[Array, "W O"]:
    """Which objects do not exist."""
    found = of(model)
    row = np.full(model.tables.num_objects, len(found.object))
    row[found.object] = np.arange(len(found.object))
    gone = jnp.asarray(states.absent)
    return jnp.concatenate([gone, jnp.zeros((gone.shape[0], 1), bool)], axis=1)[:, row]


def in_containers(model: StateModel, gone: Bool[Array, "W X"], view: PhysicsView) -> Bool[Array, "W C X"]:
    """Which container each object is in: the smallest of those that its centre is in."""
    found, containers = of(model), model.substances.containers  # type: ignore[union-attr]
    pos, quat = jnp.asarray(view.body_pos)[:, containers.body], jnp.asarray(view.body_quat)[:, containers.body]
    offset = jnp.asarray(view.object_com)[:, None, found.object] - pos[:, :, None]
    local = quat_rotate_inverse(quat[:, :, None], offset)
    heap = HEAP * containers.normal
    low, high = found.low - NEAR + np.minimum(heap, 0.0), found.high + NEAR + np.maximum(heap, 0.0)
    inside = jnp.all((local >= low[:, None]) & (local <= high[:, None]), axis=-1)
    inside &= (containers.object[:, None] != found.object) & ~gone[:, None]
    order = np.argsort(np.argsort(containers.litres))[:, None]  # the smallest is first
    first = jnp.min(jnp.where(inside, order, len(order)), axis=1, keepdims=True)
    return inside & (order == first)


def used_up(
    there: Bool[Array, "W C X"], first: Bool[Array, "W C Q"], found: Things
) -> tuple[Bool[Array, "W C X"], Bool[Array, "W X"]]:
    """Objects that the rules that apply use up, in each container and altogether: of each kind the first ones."""
    taken = jnp.zeros(there.shape, bool)
    for kind in range(len(found.kinds)):
        own = there & found.member[kind] & ~taken
        number = jnp.sum(jnp.where(first, found.needs[:, kind], 0), axis=-1)  # [W, C]
        taken = taken | (own & (jnp.cumsum(own, axis=-1) <= number[..., None]))
    return taken, jnp.any(taken, axis=1)


def enough(there: Bool[Array, "W C X"], found: Things) -> Bool[Array, "W C Q"]:
    """Whether each container has as many objects of each kind as each rule uses up."""
    if not len(found.kinds):
        return jnp.ones((*there.shape[:2], len(found.needs)), bool)
    count = jnp.sum(there[:, :, None] & found.member, axis=-1)  # [W, C, G]
    return jnp.all(count[:, :, None] >= found.needs, axis=-1)


def can_make(gone: Bool[Array, "W X"], found: Things) -> Bool[Array, "W Q"]:
    """Whether some object that each rule makes does not exist yet; true of rules that make substances."""
    if not len(found.kinds):
        return jnp.ones((gone.shape[0], len(found.needs)), bool)
    some = jnp.any(gone[:, None] & found.member, axis=-1)  # [W, G]
    return jnp.where(found.makes >= 0, some[:, np.maximum(found.makes, 0)], True)


def made(
    gone: Bool[Array, "W X"], first: Bool[Array, "W C Q"], found: Things
) -> tuple[Bool[Array, "W C X"], Int[Array, "W X"]]:
    """Objects that come to be, in which container, and their number among those of their rule."""
    placed = jnp.zeros((*first.shape[:2], gone.shape[1]), bool)
    number = jnp.zeros(gone.shape, int)
    for rule in np.flatnonzero(found.makes >= 0):
        own = gone & found.member[found.makes[rule]] & ~jnp.any(placed, axis=1)
        turn = jnp.cumsum(own, axis=-1)
        new = own & (turn <= found.count[rule])
        placed = placed | (first[:, :, rule, None] & new[:, None])
        number = jnp.where(jnp.any(first[:, :, rule], axis=1)[:, None] & new, turn - 1, number)
    return placed, number


def set_real(model: StateModel, states: ExtendedStates, obj: int, value: bool) -> ExtendedStates:
    """The states in which an object exists, or does not, in every world; NumPy arrays stay that."""
    own = of(model).object == obj
    xp = np if isinstance(states.absent, np.ndarray) else jnp
    return dataclasses.replace(states, absent=xp.where(own, not value, states.absent))


def _initial(model: StateModel) -> dict[str, np.ndarray]:
    return {"absent": np.zeros((1, len(of(model).object)), bool)}


def _from_manifest(saved: Saved) -> None:
    """From "absent", true or false."""
    own = np.flatnonzero(of(saved.model).object == saved.obj)
    if len(own) and saved.values.get("absent"):
        saved.states.absent[0, own[0]] = True


def _get(model: StateModel, states: ExtendedStates, view: PhysicsView, obj: int, world: int) -> bool:
    return bool(np.any(np.asarray(states.absent)[world] & (of(model).object == obj)))


SPEC = StateSpec(
    name="absent",
    get=_get,
    abilities=None,
    of_substances=True,
    fields={"absent": Bool[Array, "W X"]},
    initial=_initial,
    update=given_from_outside,  # rules change it (`ig2mj.states.substances.reactions`)
    idle=lambda step: jnp.array(True),
    inherit=nothing_inherited,
    from_manifest=_from_manifest,
)
