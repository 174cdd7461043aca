"""Rows of the constraint solver, compared by what they are: contacts and rows get their places by atomic counters."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from mujoco.mjx.third_party.mujoco_warp._src.types import ConstraintState, ConstraintType
from scipy.optimize import linear_sum_assignment

ROUNDING = 1e-5
"""Of the terms that a row's acceleration is the sum of, in single precision and any order."""


@dataclasses.dataclass
class Rows:
    """Rows of one world, n of them. `accelerations`: J qacc - aref, whose side of the bounds decides the state."""

    types: np.ndarray
    jacobian: np.ndarray
    masses: np.ndarray
    states: np.ndarray
    forces: np.ndarray
    accelerations: np.ndarray
    bounds: np.ndarray
    roundings: np.ndarray

    @classmethod
    def of(cls, data: Any, world: int) -> Rows:
        """Those of MuJoCo Warp's data with a sparse Jacobian and pyramidal cones."""
        efc, num = data.efc, int(data.nefc.numpy()[world])
        acceleration = data.qacc.numpy()[world].astype(float)
        first, nonzeros = efc.J_rowadr.numpy()[world], efc.J_rownnz.numpy()[world]
        columns, values = efc.J_colind.numpy()[world, 0], efc.J.numpy()[world, 0]
        jacobian = np.zeros((num, len(acceleration)))
        for row in range(num):
            entries = slice(first[row], first[row] + nonzeros[row])
            np.add.at(jacobian[row], columns[entries], values[entries])
        types, masses, states, forces, reference, loss = (
            getattr(efc, name).numpy()[world, :num] for name in ("type", "D", "state", "force", "aref", "frictionloss")
        )
        friction = np.isin(types, (ConstraintType.FRICTION_DOF, ConstraintType.FRICTION_TENDON))
        return cls(
            types,
            jacobian,
            masses,
            states,
            forces,
            jacobian @ acceleration - reference,
            np.where(friction, loss / np.maximum(masses, 1e-12), 0.0),
            ROUNDING * (1 + np.abs(jacobian) @ np.abs(acceleration) + np.abs(reference)),
        )

    def __getitem__(self, order: np.ndarray) -> Rows:
        return Rows(*(getattr(self, field.name)[order] for field in dataclasses.fields(self)))

    def at_a_bound(self) -> np.ndarray:
        """[n] bool: rounding may decide the state."""
        return np.abs(np.abs(self.accelerations) - self.bounds) <= self.roundings

    def states_of_accelerations(self) -> np.ndarray:
        """[n]: what MuJoCo's rules make of them."""
        friction = np.isin(self.types, (ConstraintType.FRICTION_DOF, ConstraintType.FRICTION_TENDON))
        inner = np.where(friction | (self.accelerations < 0), ConstraintState.QUADRATIC, ConstraintState.SATISFIED)
        inner[friction & (self.accelerations <= -self.bounds)] = ConstraintState.LINEARNEG
        inner[friction & (self.accelerations >= self.bounds)] = ConstraintState.LINEARPOS
        return np.where(self.types == ConstraintType.EQUALITY, ConstraintState.QUADRATIC, inner)


def assert_same_rows(mine: Rows, theirs: Rows, forces: float) -> None:
    """The same constraints with the same forces (to this part of the largest); states differ only at a bound."""
    assert len(mine.types) == len(theirs.types)
    if not len(mine.types):
        return
    unlike = np.abs(mine.jacobian[:, None] - theirs.jacobian[None]).sum(-1)
    unlike += np.abs(np.log(mine.masses[:, None] / theirs.masses[None]))
    unlike += mine.types[:, None] != theirs.types[None]
    order, others = linear_sum_assignment(unlike)
    assert unlike[order, others].max() < 1e-4
    mine, theirs = mine[order], theirs[others]
    assert np.abs(mine.forces - theirs.forces).max() < forces * (1 + np.abs(theirs.forces).max())
    for rows in (mine, theirs):
        assert ((rows.states == rows.states_of_accelerations()) | rows.at_a_bound()).all()
    same = mine.states == theirs.states
    assert (same | mine.at_a_bound() & theirs.at_a_bound()).all()
