"""The kitchen of the cooking demo: a fish near a stove's heat source, milk inside a fridge, a hand before the stove.

Objects are found by category, so that any home with one of each will do.
"""

from __future__ import annotations

import dataclasses
import os

import mujoco
import numpy as np

from ig2mj.agents.floating_hand import FloatingHand
from ig2mj.errors import StateError
from ig2mj.scene.scene import Scene, load_scene
from ig2mj.showcase.button_hand import FINGER_AXIS_OFFSET, REST
from ig2mj.simulation import Simulation

HAND = "hand"


@dataclasses.dataclass(frozen=True)
class Kitchen:
    """Names and numbers of one kitchen.

    Attributes:
      fish, milk, stove, fridge: names of objects.
      cook, burn, freeze: the fish's cooking and burning and the milk's freezing temperature, Celsius (taxonomy).
      button: [3] m, world frame, of the stove's button.
      approach: [3] horizontal unit vector, world frame, in which a finger moves to press it.
    """

    fish: str
    milk: str
    stove: str
    fridge: str
    cook: float
    burn: float
    freeze: float
    button: np.ndarray
    approach: np.ndarray

    @classmethod
    def of(cls, scene: Scene) -> Kitchen:
        """Finds everything. Raises StateError where something is missing."""
        fish, milk, stove, fridge = (_only(scene, c) for c in ("fish", "milk", "stove", "fridge"))
        data = scene.start_data()
        button, heat = (_link_pos(scene, data, stove, kind) for kind in ("toggle_button", "heat_source"))
        frame = data.body(scene.object(stove).bodies[0]).xmat.reshape(3, 3)
        sides = np.array([sign * frame[:, k] for k in (0, 1) for sign in (1, -1)])
        return cls(
            fish=fish,
            milk=milk,
            stove=stove,
            fridge=fridge,
            cook=_ability(scene, fish, "cookable", "cook_temperature"),
            burn=_ability(scene, fish, "burnable", "burn_temperature"),
            freeze=_ability(scene, milk, "freezable", "freeze_temperature"),
            button=button,
            approach=-sides[np.argmax(sides @ (button - heat))],
        )


def enter_kitchen(folder: str | os.PathLike) -> tuple[Simulation, Kitchen]:
    """Loads a home with a floating hand, its finger pointing at the stove's button from `REST` metres.

    Raises:
      StateError: the home lacks something that the demo needs. InputError: it cannot be read.
    """
    kitchen = Kitchen.of(load_scene(folder))
    turn, quat = _palm_down(kitchen.approach), np.zeros(4)
    mujoco.mju_mat2Quat(quat, turn.ravel())
    start = kitchen.button - REST * kitchen.approach - turn @ np.array(FINGER_AXIS_OFFSET)
    scene = load_scene(folder, agents=[FloatingHand(HAND, start, quat)])
    return Simulation(scene), kitchen


def _palm_down(forward: np.ndarray) -> np.ndarray:
    """Rotation matrix of a hand whose fingers (its -z) point forward and whose palm (its -y) faces down."""
    up = np.array([0.0, 0.0, 1.0])
    return np.stack([np.cross(up, -forward), up, -forward], axis=1)


def _only(scene: Scene, category: str) -> str:
    """The first object of a category that is in use."""
    for entry in scene.manifest.objects:
        if entry.category == category and not entry.parked:
            return entry.name
    raise StateError(f"home '{scene.name}' has no {category}, which the cooking demo needs")


def _link_pos(scene: Scene, data: mujoco.MjData, name: str, kind: str) -> np.ndarray:
    """[3] m, world frame: an annotated link of an object."""
    link = scene.object(name).links.get(kind)
    if link is None:
        raise StateError(f"'{name}' of home '{scene.name}' has no link {kind}, which the cooking demo needs")
    return np.array(data.site(link.site).xpos if link.site else data.geom(link.geom).xpos)


def _ability(scene: Scene, name: str, ability: str, parameter: str) -> float:
    found = scene.object(name).abilities.get(ability, {}).get(parameter)
    if found is None:
        raise StateError(f"'{name}' of home '{scene.name}' is not {ability}, which the cooking demo needs")
    return float(found)
