"""What a category is and can do: taxonomy, abilities, their parameters. Pure Python; needs neither JAX nor MuJoCo."""

from ig2mj.knowledge.abilities import (
    Abilities,
    abilities,
    abilities_of_synset,
    predicate,
    required_links,
    required_states,
)
from ig2mj.knowledge.ability_table import ABILITIES, Ability
from ig2mj.knowledge.bddl_data import bddl_folder
from ig2mj.knowledge.overrides import Overrides, load_overrides
from ig2mj.knowledge.taxonomy import (
    ancestors,
    categories,
    categories_of,
    descendants,
    is_a,
    synset,
    synsets,
    taxonomy,
)
from ig2mj.process.public_names import offer_modules

__all__ = [
    "ABILITIES",
    "Abilities",
    "Ability",
    "Overrides",
    "abilities",
    "abilities_of_synset",
    "ancestors",
    "bddl_folder",
    "categories",
    "categories_of",
    "descendants",
    "is_a",
    "load_overrides",
    "predicate",
    "required_links",
    "required_states",
    "synset",
    "synsets",
    "taxonomy",
]

offer_modules(__name__)
