"""Contacts of an MJX step, reduced to what the view needs. Pure JAX, all worlds at once.

MJX-Warp keeps one flat contact list for all worlds, MJX-JAX one list per world; both are
brought to one form, and reduced with one scatter.

Axes: C contacts, U units, W worlds, L links, O objects, F finger links, Y graspable bodies.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct
from jaxtyping import Bool, Float, Int
from mujoco import mjx

from ig2mj.engine.layout import ModelLayout
from ig2mj.engine.view import Array
from ig2mj.scene.tables import SceneTables


@struct.dataclass
class Contacts:
    """A flat contact list. `valid`: the row holds a contact. `geom`: the two geoms. `dist`: metres, negative inside.

    `efc_address`: rows of the constraint list that carry the contact's force, -1 none; `edges`: how many of them add up
    to the normal force (all edges of a pyramid, the first row of an elliptic cone).
    """

    valid: Bool[Array, "C"]
    world: Int[Array, "C"]
    geom: Int[Array, "C 2"]
    dist: Float[Array, "C"]
    efc_address: Int[Array, "C E"]


def warp_contacts(data: mjx.Data) -> Contacts:
    """Contacts of a batch of MJX-Warp data."""
    impl = data._impl
    count = impl.contact__dist.shape[0]
    return Contacts(
        valid=jnp.arange(count) < impl.nacon[0],
        world=impl.contact__worldid,
        geom=impl.contact__geom,
        dist=impl.contact__dist,
        efc_address=impl.contact__efc_address,
    )


def jax_contacts(data: mjx.Data) -> Contacts:
    """Contacts of a batch of MJX-JAX data: one slot for every contact that any pair of geoms could have.

    Slots without a contact are far apart. Dimensions and addresses are the same in all worlds, and known at trace time.
    """
    contact = data._impl.contact
    worlds, count = contact.dist.shape
    rows = np.maximum(1, 2 * (np.asarray(contact.dim) - 1))  # edges of the pyramid, or the one row of dimension 1
    edge = np.arange(rows.max(initial=1))
    first = np.asarray(contact.efc_address)[:, None]
    address = np.where((first >= 0) & (edge < rows[:, None]), first + edge, -1)
    return Contacts(
        valid=(contact.geom[..., 0] >= 0).reshape(-1),
        world=jnp.repeat(jnp.arange(worlds), count),
        geom=contact.geom.reshape(-1, 2),
        dist=contact.dist.reshape(-1),
        efc_address=jnp.asarray(np.tile(address, (worlds, 1)), jnp.int32),
    )


def touching_units(
    contacts: Contacts,
    layout: ModelLayout,
    tolerance: float,
    remembered: Bool[Array, "W U U"],
    unit_fresh: Bool[Array, "W U"],
) -> Bool[Array, "W U U"]:
    """Touching of units after a step.

    Args:
      contacts: of the last physics step.
      layout: which unit a geom belongs to.
      tolerance: metres.
      remembered: touching before the step.
      unit_fresh: the unit is awake. Only pairs with an awake unit have contacts; all others keep their value.
    """
    geom_unit = jnp.asarray(layout.geom_unit)
    unit = geom_unit[jnp.maximum(contacts.geom, 0)]
    near = contacts.valid & (unit >= 0).all(-1) & (contacts.geom >= 0).all(-1) & (contacts.dist <= tolerance)
    one, other = unit[:, 0], unit[:, 1]
    known = jnp.clip(contacts.world, 0, len(remembered) - 1)
    near &= unit_fresh[known, one] | unit_fresh[known, other]
    world = jnp.where(near, contacts.world, len(remembered))  # out of range: dropped
    kept = jnp.asarray(remembered & ~(unit_fresh[:, :, None] | unit_fresh[:, None, :]))
    # Each contact both ways, instead of an array of all pairs of its own and its transpose.
    return kept.at[world, one, other].set(True, mode="drop").at[world, other, one].set(True, mode="drop")


def without_ignored(
    contacts: Contacts,
    layout: ModelLayout,
    tables: SceneTables,
    tolerance: float,
    touching: Bool[Array, "W U U"],
    before: Bool[Array, "W H O"],
    after: Bool[Array, "W H O"],
) -> Bool[Array, "W U U"]:
    """Touching of units where hands begin to ignore objects, without another collision detection.

    An agent goes on touching an object that one of its hands ignores from now on where the last step has a contact of
    it with another part of the agent. What is ignored no more is seen by the next step.

    Args:
      contacts: of the last physics step. touching: after it. tolerance: metres.
      before, after: contacts of hands with objects dropped before and after the change.
    """
    if not after.size:
        return touching
    count = layout.num_object_units  # units of agents come after those of objects
    agent, thing = layout.unit_agent[count:], layout.unit_object[:count]
    of_agent = jnp.asarray(tables.hand_agent[:, None] == np.arange(len(tables.agent_names)), jnp.float32)
    begins = jnp.einsum("who,ha->wao", (after & ~before).astype(jnp.float32), of_agent) > 0
    begins = begins[:, agent][:, :, thing]  # [W, units of agents, units of objects]

    geom = jnp.maximum(contacts.geom, 0)
    unit, hand = jnp.asarray(layout.geom_unit)[geom], jnp.asarray(layout.hand_of_geom)[geom]
    owner = jnp.asarray(tables.geom_object)[geom]
    first = unit[:, 0] >= count  # the agent's geom is the contact's first
    one, other = jnp.where(first, unit[:, 0], unit[:, 1]) - count, jnp.where(first, unit[:, 1], unit[:, 0])
    hand, owner = jnp.where(first, hand[:, 0], hand[:, 1]), jnp.where(first, owner[:, 1], owner[:, 0])
    known = jnp.clip(contacts.world, 0, len(after) - 1)
    dropped = (hand >= 0) & after[known, jnp.maximum(hand, 0), jnp.maximum(owner, 0)]
    there = contacts.valid & (contacts.dist <= tolerance) & (one >= 0) & (other >= 0) & (other < count)
    world = jnp.where(there & (owner >= 0) & ~dropped, contacts.world, len(after))  # out of range: dropped
    still = jnp.zeros(begins.shape, bool).at[world, one, other].set(True, mode="drop")

    seen = touching[:, count:, :count]
    seen = jnp.where(begins, seen & still, seen)
    return jnp.asarray(touching).at[:, count:, :count].set(seen).at[:, :count, count:].set(seen.swapaxes(1, 2))


def normal_forces(contacts: Contacts, efc_force: Float[Array, "W N"], pyramidal: bool) -> Float[Array, "C"]:
    """Normal force (N) of every contact; what stands in rows without a contact means nothing."""
    address = contacts.efc_address
    rows = efc_force[jnp.clip(contacts.world, 0, efc_force.shape[0] - 1)[:, None], jnp.maximum(address, 0)]
    rows = jnp.where((address >= 0) & (address < efc_force.shape[1]), rows, 0.0)
    return rows.sum(-1) if pyramidal else rows[:, 0]


def no_forces(tables: SceneTables, num_worlds: int) -> tuple[Float[jax.Array, "W L O"], Float[jax.Array, "W F Y"]]:
    """Forces of links and fingers of a step without any."""
    link = jnp.zeros((num_worlds, len(tables.link_object), tables.num_objects), jnp.float32)
    return link, jnp.zeros((num_worlds, len(tables.finger_body), len(tables.graspable_body)), jnp.float32)


def larger_forces(
    forces: tuple[Float[Array, "W L O"], Float[Array, "W F Y"]],
    contacts: Contacts,
    efc_force: Float[Array, "W N"],
    layout: ModelLayout,
    tables: SceneTables,
    pyramidal: bool,
) -> tuple[Float[Array, "W L O"], Float[Array, "W F Y"]]:
    """The larger of `forces` and of those of the physics step that made the contacts: of annotated links on objects, of
    fingers on graspable bodies. What the scene lacks costs nothing."""
    link, finger = forces
    has_links, has_fingers = (tables.link_geom >= 0).any(), finger.size > 0
    if not has_links and not has_fingers:
        return link, finger
    normal = normal_forces(contacts, efc_force, pyramidal)
    if has_links:
        link = larger_link_forces(link, contacts, layout, tables, normal)
    if has_fingers:
        finger = jnp.maximum(finger, finger_forces(contacts, layout, tables, normal, efc_force.shape[0]))
    return link, finger


def larger_link_forces(
    force: Float[Array, "W L O"],
    contacts: Contacts,
    layout: ModelLayout,
    tables: SceneTables,
    normal: Float[Array, "C"],
) -> Float[Array, "W L O"]:
    """The larger of `force` and of the normal force (N) of any single contact between each annotated link's geom and
    each object."""
    geom = jnp.maximum(contacts.geom, 0)
    link = jnp.asarray(layout.link_of_geom)[geom]
    thing = jnp.asarray(tables.geom_object)[geom]
    for side in (0, 1):
        usable = contacts.valid & (link[:, side] >= 0) & (thing[:, 1 - side] >= 0)
        world = jnp.where(usable, contacts.world, len(force))  # out of range: dropped
        force = jnp.asarray(force).at[world, link[:, side], thing[:, 1 - side]].max(normal, mode="drop")
    return force


def finger_forces(
    contacts: Contacts, layout: ModelLayout, tables: SceneTables, normal: Float[Array, "C"], num_worlds: int
) -> Float[Array, "W F Y"]:
    """Sum of the normal forces (N) of the contacts of each finger with each graspable body."""
    geom = jnp.maximum(contacts.geom, 0)
    finger = jnp.asarray(layout.finger_of_geom)[geom]
    body = jnp.asarray(layout.graspable_of_geom)[geom]
    first = (finger[:, 0] >= 0) & (body[:, 1] >= 0)  # a finger is not a graspable body: never both ways
    one, other = jnp.where(first, finger[:, 0], finger[:, 1]), jnp.where(first, body[:, 1], body[:, 0])
    usable = contacts.valid & (one >= 0) & (other >= 0)
    world = jnp.where(usable, contacts.world, num_worlds)  # out of range: dropped
    _, force = no_forces(tables, num_worlds)
    return force.at[world, one, other].add(normal, mode="drop")
