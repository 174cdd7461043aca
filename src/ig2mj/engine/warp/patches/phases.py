"""Convex collision in two phases: distances of all pairs first, then depths and multiple contacts of touching pairs.

MuJoCo Warp's kernel of a kind does everything for a pair in one thread: GJK, for one pair in four the expanding
polytope (EPA), and for as many clipped faces. A warp takes as long as the slowest of its 32 pairs, and a kernel holds
half a megabyte of code. Here one kernel measures distances, writes the contacts of pairs that are near but apart, and
lists the others with what it found. A second kernel continues with those. Both are made of upstream's source, and
contacts are the same.
"""

# Warp's kernels only look like Python, so that type checkers must leave them alone:
# pyright: reportGeneralTypeIssues=false, reportIndexIssue=false, reportAttributeAccessIssue=false, reportArgumentType=false, reportCallIssue=false

from __future__ import annotations

import ast
import functools
import inspect
import textwrap
from typing import Any, NamedTuple

import warp as wp
from mujoco.mjx.third_party.mujoco_warp._src import collision_convex
from mujoco.mjx.third_party.mujoco_warp._src.collision_gjk import GJKResult

from ig2mj.engine.warp.patches.replacements import original
from ig2mj.engine.warp.patches.sources import defined

SECOND_BLOCK = 32
"""Threads of a block of the second phase: its pairs are few and take long, so they are spread out, and a thread may
have twice the registers."""


class _Found:
    """What the first phase found out about a pair."""

    collisionid: int
    needs_epa: bool
    dist: float
    x1: wp.vec3
    x2: wp.vec3
    index1: int
    index2: int
    result: GJKResult


Found = wp.struct(_Found)


class Phases(NamedTuple):
    """The two kernels of a kind."""

    first: wp.Kernel
    second: wp.Kernel


Arguments = tuple[int, int, int, int, bool, int, int, int]
"""Of upstream's builder of a kind's kernel."""

_arguments: dict[wp.Kernel, Arguments] = {}


def note(kernel: wp.Kernel, arguments: Arguments) -> None:
    """Remembers what a kernel of upstream's was built of."""
    _arguments[kernel] = arguments


def kind(kernel: wp.Kernel) -> tuple[int, int] | None:
    """The types of geoms that a kernel is for; None: it is none of convex pairs."""
    return _arguments[kernel][:2] if kernel in _arguments else None


class Handover(NamedTuple):
    """What first phases hand to second phases: what was found at each place [P], and for each kind the places that it
    took [K, P] and how many [K]. Places are taken from one counter (`branches`), so kinds share what was found."""

    found: wp.array
    listed: wp.array
    count: wp.array


def handover(d: Any, kinds: int) -> Handover:
    """Memory for so many kinds, with counts of 0."""
    places = max(1, d.naccdmax)
    listed = wp.empty((kinds, places), dtype=int)
    return Handover(wp.empty(places, dtype=Found), listed, wp.zeros(kinds, dtype=int))


def launches(d: Any, call: dict[str, Any], memory: Handover, number: int) -> list[dict[str, Any]]:
    """The launches of both phases in place of one of upstream's, as arguments of `warp.launch`. Nothing is allocated.

    Args:
      call: what upstream would launch. number: of its kind in `memory`.
    """
    kernel: wp.Kernel = call["kernel"]
    both = built(_arguments[kernel])
    names = [argument.label for argument in kernel.adj.args]
    values = dict(zip(names, [*call["inputs"], *call["outputs"]], strict=True))
    own = {"listed_out": memory.listed[number], "count_out": memory.count[number : number + 1]}
    values |= {"found_out": memory.found, **own}
    result = []
    most = {both.first: d.naconmax, both.second: len(memory.found)}
    for phase, block in ((both.first, call["block_dim"]), (both.second, SECOND_BLOCK)):
        values["grid_stride_in"] = collision_convex._ccd_grid_size(phase, most[phase], d.ncollision.device)
        inputs = [values[argument.label] for argument in phase.adj.args]
        result.append({"kernel": phase, "dim": values["grid_stride_in"], "block_dim": block, "inputs": inputs})
    return result


@functools.cache
def built(arguments: Arguments) -> Phases:
    """Both kernels of a kind."""
    *others, _, warn = arguments
    return Phases(_builder("first")(*arguments), _builder("second")(*others, SECOND_BLOCK, warn))


@functools.cache
def _builder(phase: str) -> Any:
    """Upstream's builder, changed into one of the first or of the second phase's kernels."""
    upstream = inspect.unwrap(original(collision_convex, "ccd_kernel_builder"))
    builder = ast.parse(textwrap.dedent(inspect.getsource(upstream))).body[0]
    assert isinstance(builder, ast.FunctionDef)
    builder.name, builder.decorator_list = f"ig2mj_{phase}_phase", []
    collide, kernel = (node for node in builder.body if isinstance(node, ast.FunctionDef))
    collide.name = f"{phase}_phase"
    kernel.name = f"ccd_{phase}_kernel"
    (_first if phase == "first" else _second)(collide, kernel)
    _rename_calls(kernel, "eval_ccd_write_contact", collide.name)
    for node in builder.body:
        if isinstance(node, ast.Return):
            node.value = ast.Name(kernel.name, ast.Load())
    text = ast.unparse(ast.fix_missing_locations(ast.Module([builder], []))) + "\n"
    return defined(builder.name, text, {**upstream.__globals__, "Found": Found, "__name__": __name__})


OUTPUTS = ("found_out: wp.array[Found]", "listed_out: wp.array[int]", "count_out: wp.array[int]")


def _first(collide: ast.FunctionDef, kernel: ast.FunctionDef) -> None:
    """Distances; what is near but apart is written, what needs more is listed."""
    _add_arguments(collide, kernel, "collisionid: int", *OUTPUTS)
    collide.body = [node for node in collide.body if not (_is_if(node, "needs_epa") or _is_multiple(node))]
    several = ast.unparse(_multiple_test())
    listing = ast.parse(
        f"""
if needs_epa or (wp.static({several}) and dist + margin < margin and gjk_result.dim > 0):
    ccdid = wp.atomic_add(nccd_in, geomgeomid, 1)
    if ccdid >= naccdmax_in:
        pass
    found = Found()
    found.collisionid = collisionid
    found.needs_epa = needs_epa
    found.dist = dist
    found.x1 = w1
    found.x2 = w2
    found.index1 = geom1.index
    found.index2 = geom2.index
    found.result = gjk_result
    found_out[ccdid] = found
    listed_out[wp.atomic_add(count_out, 0, 1)] = ccdid
    return
"""
    ).body[0]
    assert isinstance(listing, ast.If)
    listing.body[1] = _overflow()
    constants = [node for node in collide.body if _is_constant(node)]
    collide.body = [node for node in collide.body if not _is_constant(node)]
    place = 1 + next(i for i, node in enumerate(collide.body) if "gjk_phase(" in ast.unparse(node))
    collide.body[place:place] = [*constants, listing]


def _second(collide: ast.FunctionDef, kernel: ast.FunctionDef) -> None:
    """What the first phase listed."""
    _add_arguments(collide, kernel, "ccdid: int", *OUTPUTS)
    place = next(i for i, node in enumerate(collide.body) if "gjk_phase(" in ast.unparse(node))
    collide.body[place : place + 1] = ast.parse(
        """
needs_epa = found_out[ccdid].needs_epa
dist = found_out[ccdid].dist
ncollision = int(1)
w1 = found_out[ccdid].x1
w2 = found_out[ccdid].x2
gjk_result = found_out[ccdid].result
geom1.index = found_out[ccdid].index1
geom2.index = found_out[ccdid].index2
"""
    ).body
    collide.body = [node for node in collide.body if not ast.unparse(node).startswith("ccdid = int")]
    for block in [node for node in ast.walk(collide) if isinstance(node, ast.If)]:
        block.body = [node for node in block.body if not _takes_place(node)]
    loop = next(node for node in kernel.body if isinstance(node, ast.For))
    loop.target = ast.Name("listed", ast.Store())
    loop.iter = ast.parse("range(tid, wp.min(count_out[0], naccdmax_in), grid_stride_in)", mode="eval").body
    loop.body[:0] = ast.parse("ccdid = listed_out[listed]\ncollisionid = found_out[ccdid].collisionid").body


def _add_arguments(collide: ast.FunctionDef, kernel: ast.FunctionDef, *arguments: str) -> None:
    """Further arguments, first in both functions and in the call of one by the other; the kernel has no `...: int`."""
    own = ast.parse(f"def f({', '.join(arguments)}): pass").body[0]
    assert isinstance(own, ast.FunctionDef)
    collide.args.args[:0] = own.args.args
    kernel.args.args[:0] = own.args.args[1:]
    for call in _calls_of(kernel, "eval_ccd_write_contact"):
        call.args[:0] = [ast.Name(argument.arg, ast.Load()) for argument in own.args.args]


def _calls_of(node: ast.AST, name: str) -> list[ast.Call]:
    return [n for n in ast.walk(node) if isinstance(n, ast.Call) and ast.unparse(n.func) == name]


def _rename_calls(node: ast.AST, name: str, other: str) -> None:
    for call in _calls_of(node, name):
        call.func = ast.Name(other, ast.Load())


def _is_if(node: ast.stmt, test: str) -> bool:
    return isinstance(node, ast.If) and ast.unparse(node.test) == test


def _is_multiple(node: ast.stmt) -> bool:
    """Whether it is the block that finds several contacts."""
    return isinstance(node, ast.If) and "multicontact(" in ast.unparse(node)


def _takes_place(node: ast.stmt) -> bool:
    """Whether it takes a place in the buffers, or looks whether there was one."""
    return "atomic_add(nccd_in" in ast.unparse(node).split("\n")[0] or _is_if(node, "ccdid >= naccdmax_in")


def _collide_of_upstream() -> ast.FunctionDef:
    source = textwrap.dedent(inspect.getsource(inspect.unwrap(original(collision_convex, "ccd_kernel_builder"))))
    return next(n for n in ast.walk(ast.parse(source)) if isinstance(n, ast.FunctionDef) and n.name.startswith("eval"))


def _multiple_test() -> ast.expr:
    """The condition, constant for a kind, under which it has several contacts."""
    block = next(node for node in _collide_of_upstream().body if _is_multiple(node))
    assert isinstance(block, ast.If) and isinstance(block.test, ast.Call)
    return block.test.args[0]


def _is_constant(node: ast.stmt) -> bool:
    """Whether it names a constant, of which later ones are made up."""
    return isinstance(node, ast.Assign) and ast.unparse(node.value).startswith("wp.static(")


def _overflow() -> ast.stmt:
    """Upstream's answer to a full buffer."""
    full = "ccdid >= naccdmax_in"
    return next(n for n in ast.walk(_collide_of_upstream()) if isinstance(n, ast.stmt) and _is_if(n, full))
