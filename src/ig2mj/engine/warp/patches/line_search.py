"""MuJoCo Warp's line search as a function that a block's threads call, made of the source of its kernel."""

from __future__ import annotations

import ast
import functools
import inspect
import textwrap
from typing import Any

import warp as wp
from mujoco.mjx.third_party.mujoco_warp._src import solver, types

from ig2mj.engine.warp.patches.sources import defined

ARGUMENTS = (
    "nv",
    "opt_tolerance",
    "opt_ls_tolerance",
    "ne_in",
    "nf_in",
    "nefc_in",
    "qfrc_smooth_in",
    "efc_D_in",
    "efc_frictionloss_in",
    "njmax_in",
    "ctx_inertia_scale_in",
    "ctx_Jaref_in",
    "ctx_search_in",
    "ctx_search_dot_in",
    "ctx_mv_in",
    "ctx_jv_in",
    "qacc_out",
    "efc_Ma_out",
    "overflow_out",
    "ctx_Jaref_out",
)
"""Arguments of the line search, after the world and the thread."""


@functools.cache
def line_search(iterations: int, warns: int) -> wp.Function:
    """The function for pyramidal cones: steps along the direction, and returns the step's length, how much the cost
    fell, and 1 where the length was noise. All of a block's threads call it and get the same.

    Args:
      iterations: its limit. warns: `opt.warn_overflow`.
    """
    kernel = solver._linesearch_iterative_kernel(iterations, types.ConeType.PYRAMIDAL, False, False, True, warns)
    definition = ast.parse(textwrap.dedent(inspect.getsource(kernel.func))).body[0]
    assert isinstance(definition, ast.FunctionDef)
    names = inspect.getclosurevars(kernel.func).nonlocals
    definition = _Settled({name: value for name, value in names.items() if isinstance(value, bool)}).visit(definition)
    definition.decorator_list, definition.name = [ast.parse("wp.func", mode="eval").body], "ig2mj_line_search"
    definition.args.args[:0] = [ast.arg(name, ast.Name("int", ast.Load())) for name in ("worldid", "tid")]
    begin = next(i for i, line in enumerate(definition.body) if ast.unparse(line).startswith("ne = "))
    end = definition.body[-1]  # the first thread says how it went
    assert isinstance(end, ast.If)
    end.body = [line for line in end.body if isinstance(line, ast.If)]
    answer = "return wp.vec3(alpha, improvement, wp.where(wp.abs(alpha) < noise_floor, 1.0, 0.0))"
    definition.body = [*definition.body[begin:], *ast.parse(answer).body]
    used = {node.id for line in definition.body for node in ast.walk(line) if isinstance(node, ast.Name)}
    definition.args.args = [argument for argument in definition.args.args if argument.arg in used]
    assert tuple(argument.arg for argument in definition.args.args) == ("worldid", "tid", *ARGUMENTS)
    text = ast.unparse(ast.fix_missing_locations(ast.Module([definition], []))) + "\n"
    return defined(definition.name, text, {**kernel.func.__globals__, **names, "__name__": __name__})


class _Settled(ast.NodeTransformer):
    """Takes the branch of each `if wp.static(NAME)` whose name has a known value."""

    def __init__(self, known: dict[str, bool]):
        self._known = known

    def visit_If(self, node: ast.If) -> Any:
        self.generic_visit(node)
        test = node.test
        if isinstance(test, ast.Call) and ast.unparse(test.func) == "wp.static" and isinstance(test.args[0], ast.Name):
            known = self._known.get(test.args[0].id)
            if known is not None:
                return node.body if known else node.orelse
        return node
