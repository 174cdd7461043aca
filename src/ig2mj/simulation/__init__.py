"""`Simulation`: one world, with objects by name."""

from ig2mj.process.public_names import offer_modules
from ig2mj.simulation.simulation import Simulation

__all__ = ["Simulation"]

offer_modules(__name__)
