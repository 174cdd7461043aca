"""`Health`: what an engine knows about worlds that went wrong, and how full its buffers are.

Overflow of a buffer is undefined behaviour in MJX-Warp: the world goes on with contacts or
constraints missing. So the flags are kept, and guards act on them (`ig2mj.worlds.guards`).
"""

from __future__ import annotations

import enum

from flax import struct
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array


class Overflow(enum.IntFlag):
    """MJX-Warp's overflow flags (mujoco_warp, `OverflowType`)."""

    NEFC = 1 << 0
    NJMAX_NNZ = 1 << 1
    BROADPHASE = 1 << 2
    NARROWPHASE = 1 << 3
    CCD = 1 << 4
    HFIELD = 1 << 5
    CONTACT_MATCH = 1 << 6
    NVMAX = 1 << 7
    EPA_HORIZON = 1 << 8
    ITERATIONS = 1 << 9
    LS_ITERATIONS = 1 << 10
    TACTILE = 1 << 11


CAPACITY = (
    Overflow.NEFC
    | Overflow.NJMAX_NNZ
    | Overflow.BROADPHASE
    | Overflow.NARROWPHASE
    | Overflow.CCD
    | Overflow.HFIELD
    | Overflow.NVMAX
)
"""Flags that mean something was lost. The others say that a solver stopped at its limit, as C MuJoCo does silently."""

SETTING = {
    Overflow.NEFC: "constraints",
    Overflow.NJMAX_NNZ: "constraints",
    Overflow.BROADPHASE: "contacts",
    Overflow.NARROWPHASE: "contacts",
    Overflow.CCD: "convex_contacts",
    Overflow.NVMAX: "awake_dofs",
}
"""The engine profile's number to raise for each flag."""


@struct.dataclass
class Health:
    """Of every world, since it was last loaded.

    Attributes:
      overflow: or of `Overflow` flags. finite: positions and velocities are numbers.
      top_speed: m/s, of the fastest object now. wrong_controls: some control was no number, infinite or huge.
    """

    overflow: Int[Array, "W"]
    finite: Bool[Array, "W"]
    top_speed: Float[Array, "W"]
    wrong_controls: Bool[Array, "W"]


@struct.dataclass
class Usage:
    """How full the buffers were in the last physics step.

    Attributes:
      awake_dofs, constraints: per world. contacts, convex_contacts: of all worlds together (one buffer for all).
    """

    awake_dofs: Int[Array, "W"]
    constraints: Int[Array, "W"]
    contacts: Int[Array, ""]
    convex_contacts: Int[Array, ""]
