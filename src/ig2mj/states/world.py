"""`ExtendedStates` and `WorldState`: everything of a world that changes, as pytrees. Saving a world is saving these.

Axes: W worlds, O objects, C water sources, R rows of particles (the dustyable, or the stainable, objects only), N
particles of a row or drops of a source.
"""

from __future__ import annotations

from typing import Any

from flax import struct
from jaxtyping import Bool, Float, Int, UInt

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.states.definitions.water import WaterDrops
from ig2mj.states.particles import Particles
from ig2mj.states.swap import Swap


@struct.dataclass
class ExtendedStates:
    """The extended states of all objects (paper table A.4). Physical states are in the view.

    Scalars are kept for every object, because that is small and makes `states.temperature[w, o]` plain to read; an
    object without the ability keeps the initial value. Particles and drops are kept only for those that have them.

    Attributes:
      temperature: Celsius. max_temperature: Celsius, -inf before the first update. wetness: droplets absorbed.
      toggled: the switch. press_count: consecutive updates that a finger has been within reach of the button.
      sliced: of wholes and halves. water: drops. dust, stain: particles.
    """

    temperature: Float[Array, "W O"]
    max_temperature: Float[Array, "W O"]
    wetness: Float[Array, "W O"]
    toggled: Bool[Array, "W O"]
    press_count: Int[Array, "W O"]
    sliced: Bool[Array, "W O"]
    water: WaterDrops
    dust: Particles
    stain: Particles


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


__all__ = ["ExtendedStates", "Swap", "WorldState"]
