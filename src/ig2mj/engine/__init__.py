"""Physics behind one protocol: `make_engine("native" | "warp" | "jax", scene, num_worlds)`.

The engines' own modules are imported when they are first made: the native one needs neither MJX nor Warp.
"""

from ig2mj.engine.base import Engine, Snapshot, Write
from ig2mj.engine.health import Health
from ig2mj.engine.registry import make_engine
from ig2mj.engine.view import AgentView, PhysicsView
from ig2mj.process.public_names import offer_modules

__all__ = ["AgentView", "Engine", "Health", "PhysicsView", "Snapshot", "Write", "make_engine"]

offer_modules(__name__)
