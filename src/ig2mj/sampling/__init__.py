"""Sampling of states: placements that make predicates true, states set by name, disturbed and settled scenes."""

from ig2mj.process.public_names import offer_modules
from ig2mj.sampling.conditions import Condition, read_conditions
from ig2mj.sampling.many import Sampled, sample
from ig2mj.sampling.query import SceneQuery
from ig2mj.sampling.settled import make_pool

__all__ = ["Condition", "Sampled", "SceneQuery", "make_pool", "read_conditions", "sample"]

offer_modules(__name__)
