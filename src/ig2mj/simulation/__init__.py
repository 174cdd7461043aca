"""One world, for people: `Simulation`."""

from ig2mj.simulation.simulation import Simulation

__all__ = ["Simulation"]
