"""`ExtendedStates` and `WorldState`: everything of a world that changes, as pytrees. Saving a world is saving these.

Axes: W worlds, O objects, C water sources, R rows of particles (the dustyable, or the stainable, objects only), N
particles of a row or drops of a source.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

from flax import struct
from jaxtyping import Float, Int, UInt

from ig2mj.engine.view import Array, PhysicsView, counted, length
from ig2mj.states.registry import SPECS
from ig2mj.states.spec import Cut
from ig2mj.states.swap import Swap

if TYPE_CHECKING:
    _Fields = Any
else:
    _Fields = dataclasses.make_dataclass(
        "_Fields", [(name, kind) for spec in SPECS for name, kind in spec.fields.items()], frozen=True
    )


@struct.dataclass
class ExtendedStates(_Fields):
    """The extended states of all objects (paper table A.4). Physical states are in the view.

    One attribute for each of `StateSpec.fields` of `registry.SPECS`: `states.temperature[w, o]`. Scalars are kept for
    every object, because that is small and plain to read; an object without the ability keeps the initial value.
    Particles and drops are kept only for those that have them.
    """

    def inherited(self, cut: Cut) -> ExtendedStates:
        """The states after halves took over what their wholes have."""
        taken: dict[str, Any] = {}
        for spec in SPECS:
            if spec.inherit is not None:
                taken.update(spec.inherit(self, cut))
        return dataclasses.replace(self, **taken)

    def __repr__(self) -> str:
        temperature = getattr(self, "temperature", None)
        return counted(self, worlds=length(temperature), objects=length(temperature, 1))


@struct.dataclass
class WorldState:
    """All worlds of a batch at the end of a control step.

    Attributes:
      physics: the engine's own (see `ig2mj.engine.base`). view: the snapshot states and predicates read.
      states: extended states. key: JAX random key data of each world. step: control steps since reset. time: seconds.
    """

    physics: Any
    view: PhysicsView
    states: ExtendedStates
    key: UInt[Array, "W 2"]
    step: Int[Array, "W"]
    time: Float[Array, "W"]

    def __repr__(self) -> str:
        return counted(self, worlds=length(self.step))


__all__ = ["ExtendedStates", "Swap", "WorldState"]
