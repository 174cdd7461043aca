"""Instructions in plain words, and requests to primitives as data for language models.

`understand` translates "put the apple into the fridge and close it" into steps over the objects of a scene. A sentence
is clauses (`clauses.py`), a clause a verb with noun phrases (`nouns.py`); verbs are a table (`verbs.py`), and
`treatment.py` chooses tools. `tools` and `read_script` (`requests.py`) are the same requests as JSON.
"""

from ig2mj.planning.words.clauses import understand
from ig2mj.planning.words.instruction import Instruction
from ig2mj.planning.words.nouns import NotUnderstoodError
from ig2mj.planning.words.requests import read_script, script_of, step_of, tools

__all__ = ["Instruction", "NotUnderstoodError", "read_script", "script_of", "step_of", "tools", "understand"]
