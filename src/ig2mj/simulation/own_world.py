"""The physics of a `Simulation`: of one world that it owns."""

from __future__ import annotations

from ig2mj.engine.base import Engine, Physics


class OwnWorld:
    """Part of `Simulation`. Attributes: engine: what steps physics."""

    engine: Engine
    _physics: Physics

    @property
    def physics(self) -> Physics:
        """The engine's state of this world as it is now, also after a step that Ctrl-C or an error ended.

        What somebody took from here before is stale after the next step.
        """
        return self.engine.current(self._physics)

    @physics.setter
    def physics(self, physics: Physics) -> None:
        self._physics = physics
