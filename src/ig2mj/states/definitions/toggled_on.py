"""ToggledOn: a switch that an agent flips by holding a finger at its button (iGibson's toggle.py).

The paper asks for contact of the agent with the TogglingLink, which is virtual and collides with nothing. iGibson
realises that as nearness, and so do both sets of rules here: some finger's frame strictly within 0.10 m of the link at
five consecutive updates flips the switch; a finger that stays does not flip it again.

Axes: W worlds, O objects, B buttons.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Int

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.states.host import namespace
from ig2mj.states.model import StateModel
from ig2mj.states.spec import EventStep, StateSpec, Values, copied, filled, numbers, put

BUTTON_DISTANCE = 0.10
"""Metres between a finger's frame and the button (iGibson's toggle.py)."""

FAR_BEYOND = 0.01
"""Metres beyond the reach where no rounding can bring a finger back within it."""

HOLD = 5
"""Consecutive updates within reach after which the switch flips (iGibson's toggle.py)."""


def update(
    model: StateModel, toggled_on: Bool[Array, "W O"], press_count: Int[Array, "W O"], view: PhysicsView
) -> tuple[Bool[Array, "W O"], Int[Array, "W O"]]:
    """One step: the switches and the counts."""
    tables, buttons = model.tables, model.buttons
    if len(buttons) == 0 or view.agent.finger_pos.shape[1] == 0:
        return toggled_on, press_count
    offset = jnp.asarray(view.agent.finger_pos)[:, None] - jnp.asarray(view.link_pos)[:, buttons, None]
    near = jnp.any(jnp.sum(offset * offset, axis=-1) < BUTTON_DISTANCE**2, axis=-1)  # [W, B]
    of_object = np.full(tables.num_objects, len(buttons))
    of_object[tables.link_object[buttons]] = np.arange(len(buttons))
    pressed = jnp.concatenate([near, jnp.zeros((near.shape[0], 1), bool)], axis=-1)[:, of_object]
    # Beyond HOLD the count stands, so that it can be held for ever.
    count = jnp.where(pressed, jnp.minimum(press_count, HOLD) + 1, 0)
    return toggled_on ^ (count == HOLD), count


def all_out_of_reach(model: StateModel, view: PhysicsView) -> bool:
    """On the host: no finger of any world is anywhere near a button, however distances are rounded.

    Fingers change nothing then; false where anything is not finite.
    """
    fingers = np.asarray(view.agent.finger_pos)[:, :, None]
    offset = np.abs(fingers - np.asarray(view.link_pos)[:, None, model.buttons]).max(axis=-1)
    return bool((offset > BUTTON_DISTANCE + FAR_BEYOND).all())


def set_toggled_on(
    model: StateModel, toggled_on: Bool[Array, "W O"], objects: Bool[Array, "#W O"], value: bool
) -> Bool[Array, "W O"]:
    """Switches the masked objects on or off (paper table A.5)."""
    return namespace(toggled_on).where(objects & model.parameters.has("toggleable"), value, toggled_on)


def _initial(model: StateModel) -> Values:
    return {**filled(model, "toggled_on", bool, False), **filled(model, "press_count", int, 0)}


def _update(step: EventStep) -> EventStep:
    on, count = update(step.model, step.states.toggled_on, step.states.press_count, step.view)
    return step.having(toggled_on=on, press_count=count)


def _idle(step: EventStep) -> Bool[Array, ""]:
    on, count = update(step.model, step.states.toggled_on, step.states.press_count, step.view)
    return jnp.all(on == step.states.toggled_on) & jnp.all(count == step.states.press_count)


SPEC = StateSpec(
    name="toggled_on",
    get=lambda model, states, view, o, w: bool(np.asarray(states.toggled_on)[w, o]),
    abilities=("toggleable",),
    aliases=("toggled", "toggled_state"),
    fields={"toggled_on": Bool[Array, "W O"], "press_count": Int[Array, "W O"]},
    initial=_initial,
    update=_update,
    idle=_idle,
    inherit=copied("toggled_on", "press_count"),
    # The second keys are those of scenes converted by early versions.
    from_manifest=numbers(
        {"toggled_on": "toggled_on", "press_count": "press_count"}
        | {"toggled": "toggled_on", "toggled_steps": "press_count"}
    ),
    set=put("toggled_on"),
)
