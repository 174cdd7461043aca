"""Instructions in plain words, and requests to primitives as data for language models.

`understand` translates "put the apple into the fridge and close it" into steps over the objects of a scene. A sentence
is clauses (`clauses.py`), a clause a verb with noun phrases (`nouns.py`); verbs are a table (`verbs.py`).
"""

from ig2mj.planning.words.clauses import Instruction, understand
from ig2mj.planning.words.nouns import NotUnderstoodError

__all__ = ["Instruction", "NotUnderstoodError", "understand"]
