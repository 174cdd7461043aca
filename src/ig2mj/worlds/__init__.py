"""How worlds start, step and reset: one core, and its faces for batches, for debugging and for several devices."""

from ig2mj.process.public_names import offer_modules
from ig2mj.worlds.batch import Batch
from ig2mj.worlds.core import Core
from ig2mj.worlds.debug import DebugWorlds
from ig2mj.worlds.guards import Flag
from ig2mj.worlds.pool import Pool, load_pool, load_pool_scene, save_pool
from ig2mj.worlds.rules import Outcome, Rules
from ig2mj.worlds.sharding import ShardedWorlds, Shards
from ig2mj.worlds.worlds import Worlds

__all__ = [
    "Batch",
    "Core",
    "DebugWorlds",
    "Flag",
    "Outcome",
    "Pool",
    "Rules",
    "ShardedWorlds",
    "Shards",
    "Worlds",
    "load_pool",
    "load_pool_scene",
    "save_pool",
]

offer_modules(__name__)
