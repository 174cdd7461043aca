"""What a newer MuJoCo Warp means for the patches over it, before anything is installed.

    python -m pip download --no-deps -d DIR mujoco-warp && unzip DIR/mujoco_warp-*.whl -d DIR/new
    python scripts/upgrade.py compare DIR/new                what changed of all that is pinned (sources are only read)
    python scripts/upgrade.py modules DIR/new                which modules of ours can still be imported over it
    python scripts/upgrade.py pytest DIR/new ARGUMENTS...    kernel tests over it, in spite of the pins

In the last two the new sources take the place of those in MJX for this process. The engine itself needs an MJX that was
generated for them; kernel tests that call MuJoCo Warp directly do not. `docs/notes/upgrade.md` has the recipe.
"""

from __future__ import annotations

import ast
import dataclasses
import difflib
import importlib
import os
import pathlib
import pkgutil
import sys

VENDORED = "mujoco.mjx.third_party.mujoco_warp"


@dataclasses.dataclass(frozen=True)
class Found:
    """A function or constant in a module's sources: its text, and the names of its arguments (None: a constant)."""

    text: str
    arguments: tuple[str, ...] | None


def definitions(file: pathlib.Path) -> dict[str, Found]:
    """What the sources of a module define at their top level, by name."""
    text = file.read_text(encoding="utf-8")
    lines, found = text.splitlines(), dict[str, Found]()
    for node in ast.parse(text).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            first = min([node.lineno, *(d.lineno for d in node.decorator_list)])
            arguments = tuple(a.arg for a in node.args.args) if isinstance(node, ast.FunctionDef) else None
            found[node.name] = Found("\n".join(lines[first - 1 : node.end_lineno]), arguments)
        elif isinstance(node, ast.Assign):
            for target in node.targets:
                if isinstance(target, ast.Name):
                    found[target.id] = Found(ast.unparse(node), None)
    return found


def compared(old: dict[str, dict[str, Found]], new: dict[str, dict[str, Found]], pinned: dict) -> list[dict[str, str]]:
    """A row for each pinned function that is not the same in both, by module and name."""
    rows = []
    for module, names in pinned.items():
        for name in names:
            before, after = _defined(old, module, name), _defined(new, module, name)
            if after is None:
                rows.append({"module": module, "name": name, "what": "missing"})
            elif before is None or before.text != after.text:
                rows.append({"module": module, "name": name, "what": _difference(before, after)})
    return rows


def _defined(sources: dict[str, dict[str, Found]], module: str, name: str) -> Found | None:
    """By the module, or by the one that it imports the name from."""
    known = sources.get(module, {})
    return known.get(name) or next((found[name] for found in sources.values() if name in found), None)


def _difference(before: Found | None, after: Found) -> str:
    if before is None:
        return "changed"
    lines = list(difflib.unified_diff(before.text.splitlines(), after.text.splitlines(), n=0, lineterm=""))[2:]
    removed, added = (sum(line.startswith(sign) for line in lines) for sign in "-+")
    what = f"changed: {removed} lines removed, {added} added"
    if before.arguments is not None and after.arguments is not None and before.arguments != after.arguments:
        gone = [a for a in before.arguments if a not in after.arguments]
        come = [a for a in after.arguments if a not in before.arguments]
        parts = [f"without {', '.join(gone)}"] * bool(gone) + [f"with {', '.join(come)}"] * bool(come)
        what += f"; arguments {' and '.join(parts) or 'in another order'}"
    return what


def compare(folder: pathlib.Path) -> None:
    """Prints a table in Markdown."""
    import mujoco.mjx.third_party.mujoco_warp as vendored

    from ig2mj.engine.warp.patches.pins import PINS, VERSION

    assert vendored.__file__
    prefix = "third_party.mujoco_warp._src."
    pinned = {name.removeprefix(prefix): names for name, names in PINS.items() if name.startswith(prefix)}
    old, new = (
        {file.stem: definitions(file) for file in (path / "_src").glob("*.py") if not file.stem.endswith("_test")}
        for path in (pathlib.Path(vendored.__file__).parent, folder / "mujoco_warp")
    )
    rows = compared(old, new, pinned)
    count = sum(map(len, pinned.values()))
    missing = sum(row["what"].startswith("missing") for row in rows)
    print(f"Of {count} functions and constants pinned for MJX {VERSION}, {missing} are missing and", end=" ")
    print(f"{len(rows) - missing} have changed.\n\n| function | |\n|---|---|")
    for row in rows:
        print(f"| `{row['module']}.{row['name']}` | {row['what']} |")


def take_place(folder: pathlib.Path) -> None:
    """Puts the modules of the new sources where MJX has its own, in this process."""
    sys.path.insert(0, str(folder))
    os.environ["IG2MJ_TRY_KERNELS"] = "1"
    package = importlib.import_module("mujoco_warp")
    sys.modules[VENDORED] = package
    for info in pkgutil.walk_packages(package.__path__, "mujoco_warp."):
        if "_test" in info.name or "test_data" in info.name or info.name.split(".")[1] != "_src":
            continue
        sys.modules[info.name.replace("mujoco_warp", VENDORED, 1)] = importlib.import_module(info.name)


def modules(folder: pathlib.Path) -> None:
    """Prints which modules of the patches can be imported."""
    take_place(folder)
    import ig2mj.engine.warp.patches as patches

    for info in pkgutil.iter_modules(patches.__path__):
        name = f"{patches.__name__}.{info.name}"
        try:
            importlib.import_module(name)
        except Exception as failure:
            print(f"fails     {info.name}: {type(failure).__name__}: {str(failure).splitlines()[0]}")
        else:
            print(f"imported  {info.name}")


def main(words: list[str]) -> int:
    if len(words) < 2 or words[0] not in ("compare", "modules", "pytest"):
        print(__doc__)
        return 2
    folder = pathlib.Path(words[1])
    if words[0] == "pytest":
        take_place(folder)
        import pytest

        return int(pytest.main(words[2:]))
    (compare if words[0] == "compare" else modules)(folder)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
