"""What the contact list of C MuJoCo says: which units touch, and how hard annotated links and fingers press."""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import mujoco
import numpy as np

from ig2mj.engine.layout import ModelLayout


def touching_units(
    data: mujoco.MjData, geom_unit: np.ndarray, tolerance: float, remembered: np.ndarray, fresh: np.ndarray
) -> np.ndarray:
    """Touching of units after a step.

    Args:
      data: its contacts are those of the present positions.
      geom_unit: [G] unit of each geom, -1 none.
      tolerance: metres.
      remembered: [U, U] touching before the step.
      fresh: [U, U] pairs of which one is awake: only of these do contacts tell anything.

    Returns:
      [U, U] symmetric; `remembered` itself where nothing changed.
    """
    touching = remembered & ~fresh
    if data.ncon:
        contact = data.contact
        units = geom_unit[contact.geom]
        near = (units[:, 0] >= 0) & (units[:, 1] >= 0) & (contact.dist <= tolerance)
        one, other = units[near].T
        touching[one, other] = True
        touching[other, one] = True
    return remembered if np.array_equal(touching, remembered) else touching


LINK, FINGER = 1, 2
"""Kinds of forces of interest, bits: an annotated link's on an object, a finger's on a graspable body."""

_SECOND = 2
"""Bits by which those of a contact's second geom are shifted."""


class StepContacts(NamedTuple):
    """Copies of what the forces of a physics step are computed from.

    Attributes:
      meets: [C] bits: kinds of what the first geom presses with, and, shifted, of what the second one does.
      geom, address, dim: [C, 2], [C], [C] MuJoCo's. force: [nefc] forces of constraints.
    """

    meets: np.ndarray
    geom: np.ndarray
    address: np.ndarray
    dim: np.ndarray
    force: np.ndarray


@dataclasses.dataclass(frozen=True, eq=False)
class ForcePlan:
    """Constants of a scene, by which contacts whose forces are of interest are found.

    Attributes:
      first, second: [G] bits of a geom as the first and as the second one of a contact; a contact's kinds are those
        that both have. kinds: those that the scene can have.
      pyramidal: of the friction cone. shape: [F, Y].
    """

    layout: ModelLayout
    geom_object: np.ndarray
    first: np.ndarray
    second: np.ndarray
    kinds: int
    pyramidal: bool
    shape: tuple[int, int]

    @classmethod
    def build(cls, layout: ModelLayout, geom_object: np.ndarray, pyramidal: bool, shape: tuple[int, int]) -> ForcePlan:
        """Of an engine's model."""
        pressing = LINK * (layout.link_of_geom >= 0) + FINGER * (layout.finger_of_geom >= 0)
        pressed = LINK * (geom_object >= 0) + FINGER * (layout.graspable_of_geom >= 0)
        return cls(
            layout=layout,
            geom_object=geom_object,
            first=(pressing + (pressed << _SECOND)).astype(np.uint8),
            second=(pressed + (pressing << _SECOND)).astype(np.uint8),
            kinds=sum(kind for kind in (LINK, FINGER) if (pressing & kind).any() and (pressed & kind).any()),
            pyramidal=pyramidal,
            shape=shape,
        )

    def collect(self, data: mujoco.MjData) -> StepContacts | None:
        """Contacts of the physics step just taken, copied; None where no force is of interest."""
        if not data.ncon:
            return None
        contact = data.contact
        geom = contact.geom
        meets = self.first.take(geom[:, 0]) & self.second.take(geom[:, 1])
        if not np.count_nonzero(meets):
            return None
        return StepContacts(
            meets, geom.copy(), contact.efc_address.copy(), contact.dim.copy(), np.array(data.efc_force)
        )

    def has_links(self, contacts: StepContacts) -> bool:
        """Whether an annotated link is in any of the contacts."""
        return bool(np.count_nonzero(contacts.meets & (LINK | LINK << _SECOND)))

    def has_fingers(self, contacts: StepContacts) -> bool:
        """Whether a finger is in any of the contacts."""
        return bool(np.count_nonzero(contacts.meets & (FINGER | FINGER << _SECOND)))

    def add_links(self, contacts: StepContacts, link_force: np.ndarray) -> bool:
        """Raises forces [L, O] (N) to those of a physics step, of the largest single contact, as in iGibson's slicer
        (iGibson's slicer.py); says whether any was found."""
        own, other, normal, _ = self._normals(contacts, LINK)
        np.maximum.at(link_force, (self.layout.link_of_geom[own], self.geom_object[other]), normal)
        return len(own) > 0

    def of_fingers(self, steps: list[StepContacts]) -> np.ndarray:
        """Forces [F, Y] (N) of a control step: of each physics step the sum over the contacts of a finger with a
        graspable body, of all of them the largest."""
        if not steps:
            return np.zeros(self.shape, np.float32)
        number = np.repeat(np.arange(len(steps)), [len(contacts.meets) for contacts in steps])
        own, other, normal, row = self._normals(_joined(steps), FINGER)
        total = np.zeros((len(steps), *self.shape), np.float32)
        finger, body = self.layout.finger_of_geom[own], self.layout.graspable_of_geom[other]
        np.add.at(total, (number[row], finger, body), normal)
        return total.max(0)

    def _normals(self, contacts: StepContacts, kind: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Of contacts of a kind that act: the geom that presses, the one pressed on, the normal force (N); which of the
        contacts they are."""
        sides = [((contacts.meets & (kind << shift)) != 0) & (contacts.address >= 0) for shift in (0, _SECOND)]
        row, side = np.stack(sides, 1).nonzero()
        address = contacts.address[row]
        normal = contacts.force[address]
        if self.pyramidal:  # the normal force is the sum over the pyramid's edges, two per friction direction
            edges = 2 * (contacts.dim[row] - 1)
            for k in range(1, int(edges.max(initial=0))):
                more = edges > k
                normal = normal + np.where(more, contacts.force[np.where(more, address + k, 0)], 0.0)
        return contacts.geom[row, side], contacts.geom[row, 1 - side], normal, row


def _joined(steps: list[StepContacts]) -> StepContacts:
    """The contacts of all steps one after the other, as of one step."""
    if len(steps) == 1:
        return steps[0]
    first = np.cumsum([0, *(len(contacts.force) for contacts in steps[:-1])])
    address = [np.where(c.address >= 0, c.address + at, c.address) for c, at in zip(steps, first, strict=True)]
    return StepContacts(
        meets=np.concatenate([c.meets for c in steps]),
        geom=np.concatenate([c.geom for c in steps]),
        address=np.concatenate(address),
        dim=np.concatenate([c.dim for c in steps]),
        force=np.concatenate([c.force for c in steps]),
    )


class FingerForces:
    """`AgentView.finger_force`, computed when somebody reads it first."""

    def __init__(self, plan: ForcePlan, pressing: list[list[StepContacts]]):
        """`pressing`: of each world, contacts of the physics steps of a control step; nobody changes them any more."""
        self._plan, self._pressing = plan, pressing
        self._made: np.ndarray | None = None

    def __call__(self) -> np.ndarray:
        """[W, F, Y] in newtons."""
        if self._made is None:
            self._made = np.stack([self._plan.of_fingers(steps) for steps in self._pressing])
        return self._made
