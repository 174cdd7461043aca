"""Images and windows of a `Simulation`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from ig2mj.simulation.simulation import Simulation
    from ig2mj.viewer.live import LiveWindow


def render(simulation: Simulation, camera: Any, width: int, height: int, **options: Any) -> np.ndarray:
    """See `Simulation.render`."""
    from ig2mj.looks import visual_of
    from ig2mj.viewer import offscreen, state_effects, state_marks

    visual = visual_of(simulation.scene)
    data = visual.data(*simulation.engine.to_mujoco(simulation.physics, 0))
    model = visual.model
    if simulation.state_options is None or options.get("segmentation"):
        return offscreen.render(model, data, camera, width=width, height=height, **options)
    world = simulation.state_model, simulation.states, simulation.view
    found = [*state_marks.marks(*world), *state_effects.effects(*world, time=simulation.time)]
    options.setdefault("decorate", lambda scene: state_marks.draw_marks(scene, found))
    tint = state_marks.tint_of_objects(simulation.state_model, simulation.states)
    with state_marks.Tinter(model, visual.owner).shown(tint):
        return offscreen.render(model, data, camera, width=width, height=height, **options)


def launch_viewer(simulation: Simulation, **options: Any) -> None:
    """See `Simulation.launch_viewer`."""
    from ig2mj.viewer import interactive

    interactive.launch(simulation, **_options(simulation, options))


def viewer(simulation: Simulation, **options: Any) -> LiveWindow:
    """See `Simulation.viewer`."""
    from ig2mj.viewer.live import LiveWindow

    window = LiveWindow(simulation.scene, lambda: simulation.data, **_options(simulation, options))
    return window


def _options(simulation: Simulation, options: dict[str, Any]) -> dict[str, Any]:
    """With overlays of the world's states, and the pace of its steps."""
    from ig2mj.viewer import overlays, states_overlay

    if simulation.state_options is not None:
        shown = [
            *overlays.default_overlays(simulation.scene, simulation),
            states_overlay.StatesOverlay(simulation, simulation.model),
        ]
        options.setdefault("overlays", shown)
    options.setdefault("step_time", simulation.engine.substeps * simulation.engine.timestep)
    return options
