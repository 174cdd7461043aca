"""A copy of a kernel that does nothing where a condition holds."""

from __future__ import annotations

import ast
import inspect
import linecache
import textwrap
from typing import Any

import warp as wp


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
    function = kernel.func
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    definition = tree.body[0]
    assert isinstance(definition, ast.FunctionDef)
    definition.decorator_list = []
    definition.name = "guarded_" + kernel.key.split("__locals__")[0].strip("_")
    further = [ast.arg(name, ast.Name(f"_type_of_{name}", ast.Load())) for name in arguments]
    definition.args.args = [*further, *definition.args.args]
    place = next(i for i, line in enumerate(definition.body) if ast.unparse(line).endswith("wp.tid()"))
    definition.body[place + 1 : place + 1] = ast.parse(f"if {condition}:\n{textwrap.indent(instead, '    ')}").body
    text = ast.unparse(ast.fix_missing_locations(tree)) + "\n"
    file = f"<{definition.name}>"
    linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)  # for tracebacks
    space: dict[str, Any] = {**function.__globals__, **inspect.getclosurevars(function).nonlocals, **names}
    space |= {f"_type_of_{name}": annotation for name, annotation in arguments.items()} | {"__name__": module}
    exec(compile(text, file, "exec", dont_inherit=True), space)
    own = wp.get_module(module)
    own.options |= {"enable_backward": False}
    return wp.Kernel(space[definition.name], definition.name, own, dict(kernel.options), source=text)
