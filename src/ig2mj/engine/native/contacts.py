"""What the contact list of C MuJoCo says: which units touch, and how hard annotated links and fingers press."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from ig2mj.engine.layout import ModelLayout


def touching_units(units: np.ndarray, near: np.ndarray, remembered: np.ndarray, fresh: np.ndarray) -> np.ndarray:
    """Touching of units after a step.

    Args:
      units: [C, 2] of the contacts of the present positions, -1 none. near: [C] within the tolerance.
      remembered: [U, U] touching before the step.
      fresh: [U, U] pairs of which one is awake: only of these do contacts tell anything.

    Returns:
      [U, U] symmetric; `remembered` itself where nothing changed.
    """
    touching = remembered & ~fresh
    for one, other in units[near].tolist():  # few: a loop is faster than indexing by arrays
        if one >= 0 and other >= 0:
            touching[one, other] = touching[other, one] = True
    return remembered if touching.tobytes() == remembered.tobytes() else touching


LINK, FINGER = 1, 2
"""Kinds of forces of interest, bits: an annotated link's on an object, a finger's on a graspable body."""

_SECOND = 2
"""Bits by which those of a contact's second geom are shifted."""


class Met(NamedTuple):
    """Which geoms the contact list names, and what follows from them alone: mostly the same for many steps.

    Attributes:
      key: tells lists apart. geom, dim: [C, 2], [C] MuJoCo's, copied.
      meets: [C] bits: kinds of what the first geom presses with, and, shifted, of what the second one does.
      kinds: all that any of the contacts has.
    """

    key: bytes
    geom: np.ndarray
    dim: np.ndarray
    meets: np.ndarray
    kinds: int


NOTHING_MET = Met(b"", np.zeros((0, 2), np.int32), np.zeros(0, np.int32), np.zeros(0, np.uint8), 0)


class StepContacts(NamedTuple):
    """Copies of what the forces of a physics step are computed from.

    Attributes:
      met: the contacts. address: [C] MuJoCo's. force: [nefc] forces of constraints.
    """

    met: Met
    address: np.ndarray
    force: np.ndarray


class KnownForces(NamedTuple):
    """In place of the contacts of a control step: the forces [F, Y] (N) that were computed from them."""

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

    def met(self, data: mujoco.MjData, last: Met) -> Met:
        """What the contact list names; `last`, what it named before, where that is the same."""
        if not data.ncon:
            return NOTHING_MET
        contact = data.contact
        geom = contact.geom
        key = geom.tobytes()
        if key == last.key:
            return last
        meets = self.first.take(geom[:, 0]) & self.second.take(geom[:, 1])
        every = int(np.bitwise_or.reduce(meets))
        return Met(key, geom.copy(), contact.dim.copy(), meets, (every | every >> _SECOND) & (LINK | FINGER))

    def collect(self, data: mujoco.MjData, met: Met) -> StepContacts | None:
        """Contacts of the physics step just taken, copied; None where no force is of interest."""
        if not met.kinds:
            return None
        return StepContacts(met, data.contact.efc_address.copy(), np.array(data.efc_force))

    def add_links(self, contacts: StepContacts, link_force: np.ndarray) -> bool:
        """Raises forces [L, O] (N) to those of a physics step, of the largest single contact, as in iGibson's slicer
        (iGibson's slicer.py); says whether any was found."""
        own, other, normal, _ = self._normals(contacts, LINK)
        np.maximum.at(link_force, (self.layout.link_of_geom[own], self.geom_object[other]), normal)
        return len(own) > 0

    def of_fingers(self, steps: Sequence[StepContacts | KnownForces]) -> np.ndarray:
        """Forces [F, Y] (N) of a control step: of each physics step the sum over the contacts of a finger with a
        graspable body, of all of them the largest."""
        if not steps:
            return np.zeros(self.shape, np.float32)
        if isinstance(steps[0], KnownForces):
            return steps[0].force
        steps = [step for step in steps if isinstance(step, StepContacts)]
        number = np.repeat(np.arange(len(steps)), [len(contacts.address) for contacts in steps])
        own, other, normal, row = self._normals(_joined(steps), FINGER)
        total = np.zeros((len(steps), *self.shape), np.float32)
        finger, body = self.layout.finger_of_geom[own], self.layout.graspable_of_geom[other]
        np.add.at(total, (number[row], finger, body), normal)
        return total.max(0)

    def _normals(self, contacts: StepContacts, kind: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Of contacts of a kind that act: the geom that presses, the one pressed on, the normal force (N); which of the
        contacts they are."""
        met = contacts.met
        sides = [((met.meets & (kind << shift)) != 0) & (contacts.address >= 0) for shift in (0, _SECOND)]
        row, side = np.stack(sides, 1).nonzero()
        address = contacts.address[row]
        normal = contacts.force[address]
        if self.pyramidal:  # the normal force is the sum over the pyramid's edges, two per friction direction
            edges = 2 * (met.dim[row] - 1)
            for k in range(1, int(edges.max(initial=0))):
                more = edges > k
                normal = normal + np.where(more, contacts.force[np.where(more, address + k, 0)], 0.0)
        return met.geom[row, side], met.geom[row, 1 - side], normal, row


def _joined(steps: list[StepContacts]) -> StepContacts:
    """The contacts of all steps one after the other, as of one step."""
    if len(steps) == 1:
        return steps[0]
    first = np.cumsum([0, *(len(contacts.force) for contacts in steps[:-1])])
    address = [np.where(c.address >= 0, c.address + at, c.address) for c, at in zip(steps, first, strict=True)]
    met = Met(
        key=b"",
        geom=np.concatenate([c.met.geom for c in steps]),
        dim=np.concatenate([c.met.dim for c in steps]),
        meets=np.concatenate([c.met.meets for c in steps]),
        kinds=LINK | FINGER,
    )
    return StepContacts(met, np.concatenate(address), np.concatenate([c.force for c in steps]))


class FingerForces:
    """`AgentView.finger_force`, computed on first read."""

    def __init__(self, plan: ForcePlan, pressing: Sequence[Sequence[StepContacts | KnownForces]]):
        """`pressing`: of each world, contacts of the physics steps of a control step; they are not changed later."""
        self._plan, self._pressing = plan, pressing
        self._made: np.ndarray | None = None

    def __call__(self) -> np.ndarray:
        """[W, F, Y] in newtons."""
        if self._made is None:
            self._made = np.stack([self._plan.of_fingers(steps) for steps in self._pressing])
        return self._made
