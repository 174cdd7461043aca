"""Copies of kernels of MuJoCo Warp's: with a guard, or with a loop over what its threads did one each."""

from __future__ import annotations

import ast
import inspect
import textwrap
from typing import Any

import warp as wp

from ig2mj.engine.warp.patches.sources import defined


def guarded(
    kernel: wp.Kernel,
    condition: str,
    arguments: dict[str, Any],
    names: dict[str, Any],
    instead: str = "return",
    module: str = __name__,
) -> wp.Kernel:
    """The kernel with further arguments, which come first, and a guard after its line `... = wp.tid()`.

    Args:
      condition: expression over the kernel's arguments, its indices, `arguments` and `names`.
      arguments: annotations of the further arguments. names: functions of Warp that the condition calls.
      instead: what is done where the condition holds; ends with "return".
      module: name of the Warp module that the copy becomes a part of.
    """
    definition = _definition(kernel, "guarded")
    further = [ast.arg(name, ast.Name(f"_type_of_{name}", ast.Load())) for name in arguments]
    definition.args.args = [*further, *definition.args.args]
    place = 1 + _place_of_tid(definition)
    definition.body[place:place] = ast.parse(f"if {condition}:\n{textwrap.indent(instead, '    ')}").body
    names = names | {f"_type_of_{name}": annotation for name, annotation in arguments.items()}
    return _kernel(kernel, definition, names, module)


def strided(kernel: wp.Kernel, index: str, count: str, lanes: int, module: str) -> wp.Kernel:
    """The kernel for so many threads of each world: each takes every `lanes`-th of what the second index went over.

    A third index, of which there must be one value only, is 0.

    Args:
      index: name of the second index. count: expression for the end of its range.
    """
    definition = _definition(kernel, "strided")
    place = _place_of_tid(definition)
    line = definition.body[place]
    assert isinstance(line, ast.Assign) and isinstance(line.targets[0], ast.Tuple)
    names = [ast.unparse(name) for name in line.targets[0].elts]
    assert names[1] == index
    begin = [f"{names[0]}, lane = wp.tid()", *(f"{name} = 0" for name in names[2:])]
    loop = ast.parse(f"for {index} in range(lane, {count}, {lanes}):\n    over = bool(False)").body[0]
    assert isinstance(loop, ast.For)
    loop.body += _in_a_loop(definition.body[place + 1 :])
    definition.body[place:] = [*ast.parse("\n".join(begin)).body, loop]
    return _kernel(kernel, definition, {}, module)


def _in_a_loop(lines: list[ast.stmt]) -> list[ast.stmt]:
    """Lines of a body in which "return" becomes "continue" of a loop around them."""
    result: list[ast.stmt] = []
    for line in lines:
        if isinstance(line, ast.Return):
            result.append(ast.Continue())
        elif isinstance(line, ast.If):
            line.body, line.orelse = _in_a_loop(line.body), _in_a_loop(line.orelse)
            result.append(line)
        elif isinstance(line, ast.For | ast.While) and any(isinstance(inner, ast.Return) for inner in ast.walk(line)):
            result += [_Leaves().visit(line), *ast.parse("if over:\n    continue").body]
        else:
            result.append(line)
    return result


class _Leaves(ast.NodeTransformer):
    """In a loop within the loop a "return" leaves it and says so."""

    def visit_Return(self, node: ast.Return) -> list[ast.stmt]:
        return ast.parse("over = True\nbreak", mode="exec").body if node else []


def _definition(kernel: wp.Kernel, prefix: str) -> ast.FunctionDef:
    """A kernel's function, without its decorator and with a name of ours."""
    definition = ast.parse(textwrap.dedent(inspect.getsource(kernel.func))).body[0]
    assert isinstance(definition, ast.FunctionDef)
    definition.decorator_list = []
    definition.name = f"{prefix}_" + kernel.key.split("__locals__")[0].strip("_")
    return definition


def _place_of_tid(definition: ast.FunctionDef) -> int:
    return next(i for i, line in enumerate(definition.body) if ast.unparse(line).endswith("wp.tid()"))


def _kernel(kernel: wp.Kernel, definition: ast.FunctionDef, names: dict[str, Any], module: str) -> wp.Kernel:
    """The kernel of a changed definition, in the Warp module of this name."""
    text = ast.unparse(ast.fix_missing_locations(ast.Module([definition], []))) + "\n"
    closure = inspect.getclosurevars(kernel.func).nonlocals
    space = {**kernel.func.__globals__, **closure, **names, "__name__": module}
    changed = defined(definition.name, text, space)
    own = wp.get_module(module)
    own.options |= {"enable_backward": False}
    return wp.Kernel(changed, definition.name, own, dict(kernel.options), source=text)
