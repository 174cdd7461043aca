"""Logical predicates (paper table A.1) and the logic over them.

`PREDICATES` lists them; `compile_expression` turns an expression, which may be one predicate of named objects, into a
function of all worlds.
"""

from ig2mj.predicates.base import Context, Predicate
from ig2mj.predicates.compile import CompiledExpression, GoalStatus, compile_expression
from ig2mj.predicates.literals import AbilityWarning, ArityError, Literals, resolve
from ig2mj.predicates.logic import (
    And,
    Atom,
    Exists,
    Expression,
    ForAll,
    ForN,
    ForNPairs,
    ForPairs,
    Not,
    Or,
    atom,
    implies,
)
from ig2mj.predicates.parse import ExpressionError, parse
from ig2mj.predicates.registry import PREDICATES, find
from ig2mj.process.public_names import offer_modules

__all__ = [
    "PREDICATES",
    "AbilityWarning",
    "And",
    "ArityError",
    "Atom",
    "CompiledExpression",
    "Context",
    "Exists",
    "Expression",
    "ExpressionError",
    "ForAll",
    "ForN",
    "ForNPairs",
    "ForPairs",
    "GoalStatus",
    "Literals",
    "Not",
    "Or",
    "Predicate",
    "atom",
    "compile_expression",
    "find",
    "implies",
    "parse",
    "resolve",
]

offer_modules(__name__)
