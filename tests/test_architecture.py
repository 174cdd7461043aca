"""The house's rules: who may import whom, and what is packed (docs/design/architecture.md)."""

from __future__ import annotations

import ast
import fnmatch
import functools
import pathlib
import re
import tomllib

import networkx
import pytest

ROOT = pathlib.Path(__file__).resolve().parents[1]
SRC = ROOT / "src" / "ig2mj"

#: Rooms of the package, lowest first. One may import itself and what stands before it.
LAYERS = [
    "errors",
    "install_hint",
    "callbacks",
    "files",
    "process",
    "plugins",
    "cluster",
    "knowledge",
    "scene",
    "looks",
    "geometry",
    "engine",
    "agents",
    "states",
    "predicates",
    "worlds",
    "sampling",
    "sensors",
    "tasks",
    "planning",
    "envs",
    "testing",
    "demos",
    "learn",
    "serving",
    "viewer",
    "simulation",
    "web",
    "vr",
    "calibration",
    "diagnosis",
    "showcase",
    "cli",
    "__main__",
]
#: Packages and modules of the converter, lowest first.
CONVERTER_LAYERS = [
    "base",
    "hulls",
    "bodies",
    "reading",
    "mjcf",
    "checks",
    "report",
    "model_task",
    "finish",
    "convert_object",
    "convert_scene",
    "conversion",
    "convert_mjcf_robot",
    "convert_robot",
    "upgrade",
]
MOST_LINES, MOST_COLLABORATORS = 600, 32
"""Of a module: lines, and modules of ours that it imports. Both are far above the median: a module that reaches them
has a second responsibility."""

REGISTRIES = {"predicates/registry.py", "sensors/registry.py"}
"""They import one module for each entry."""

#: Room -> packages that must not appear in it, not even inside a function.
FORBIDDEN = {
    "files": {"jax", "flax", "mujoco", "warp"},
    "knowledge": {"jax", "flax", "mujoco", "warp", "numpy", "bddl"},
    "geometry": {"mujoco", "warp"},
    "states": {"mujoco", "warp"},
    "predicates": {"mujoco", "warp"},
}
#: Packages beside `ig2mj` -> what they may import of it.
GUESTS = {
    "converters": (
        "ig2mj.knowledge",
        "ig2mj.scene.manifest",
        "ig2mj.scene.mjcf_files",
        "ig2mj.scene.mjcf_text",
        "ig2mj.errors",
        "ig2mj.install_hint",
        "ig2mj.process.own_version",
        "ig2mj.files",
        "ig2mj.callbacks",
    ),
    "homes": (
        "ig2mj.knowledge",
        "ig2mj.scene.manifest",
        "ig2mj.errors",
        "ig2mj.install_hint",
        "ig2mj.files",
        "ig2mj.callbacks",
    ),
}
GUEST_NAMES = {"ig2mj_converters", "ig2mj_homes"}


@functools.cache
def imports_of(file: pathlib.Path, typing_too: bool = False) -> list[tuple[int, str]]:
    """(line, absolute module name) of every import that runs, also those inside functions and by `import_module`.

    What stands under `if TYPE_CHECKING` never runs and counts only with `typing_too`. `from a import b` gives "a.b".
    """
    tree = ast.parse(file.read_text(encoding="utf-8"), str(file))
    nodes = list(ast.walk(tree))
    typing_only = {
        id(inner)
        for node in nodes
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)
        for statement in node.body
        for inner in ast.walk(statement)
    }
    package = module_name(file).split(".") if file.name == "__init__.py" else module_name(file).split(".")[:-1]
    found = []
    for node in nodes:
        if id(node) in typing_only and not typing_too:
            continue
        if isinstance(node, ast.Import):
            found += [(node.lineno, alias.name) for alias in node.names]
        elif isinstance(node, ast.Call) and "import_module" in (
            getattr(node.func, "attr", ""),
            getattr(node.func, "id", ""),
        ):
            found += [(node.lineno, arg.value) for arg in node.args if isinstance(arg, ast.Constant)]
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            module = ".".join([*base, *([node.module] if node.module else [])])
            found += [(node.lineno, f"{module}.{alias.name}") for alias in node.names]
    return found


def modules() -> dict[str, pathlib.Path]:
    return {module_name(f): f for f in sources(SRC, ROOT / "converters", ROOT / "homes")}


def module_name(file: pathlib.Path) -> str:
    for folder, package in ((SRC, "ig2mj"), (ROOT / "converters", "ig2mj_converters"), (ROOT / "homes", "ig2mj_homes")):
        if file.is_relative_to(folder):
            parts = file.relative_to(folder).with_suffix("").parts
            return ".".join([package, *(p for p in parts if p != "__init__")])
    raise AssertionError(file)


def room_of(file: pathlib.Path) -> str:
    return file.relative_to(SRC).with_suffix("").parts[0]


def sources(*folders: pathlib.Path) -> list[pathlib.Path]:
    return sorted(f for folder in folders for f in folder.rglob("*.py") if "__pycache__" not in f.parts)


def test_every_room_of_the_package_has_its_place_in_the_order():
    rooms = {room_of(f) for f in sources(SRC)} - {"__init__"}
    assert rooms <= set(LAYERS), f"add {sorted(rooms - set(LAYERS))} to LAYERS and to docs/design/architecture.md"


def test_the_order_is_that_of_the_document():
    """docs/design/architecture.md lists the rooms that there are, in the order of LAYERS."""
    text = (ROOT / "docs" / "design" / "architecture.md").read_text(encoding="utf-8")
    rows = [line.split("|")[1] for line in text.splitlines() if line.startswith("| `")]
    told = [name for row in rows for name in re.findall(r"`(\w+)`", row) if name in LAYERS]
    there = {room_of(f) for f in sources(SRC)} - {"__init__", "__main__"}
    assert there <= set(told)
    assert told == sorted(told, key=LAYERS.index)


def test_imports_run_downwards_only():
    """Also those that only type checkers see: who knows a type knows the room."""
    wrong = []
    for file in sources(SRC):
        room = room_of(file)
        if room == "__init__":
            continue
        for line, name in imports_of(file, typing_too=True):
            parts = name.split(".")
            if parts[0] == "ig2mj" and len(parts) > 1 and parts[1] in LAYERS:
                if LAYERS.index(parts[1]) > LAYERS.index(room):
                    wrong.append(f"{file.relative_to(ROOT)}:{line}: {room} imports {name}")
            elif parts[0] == "ig2mj" and room not in ("cli", "showcase", "__main__"):
                wrong.append(f"{file.relative_to(ROOT)}:{line}: imports {name} from the public surface")
    assert not wrong, "\n".join(wrong)


def test_every_part_of_the_converter_has_its_place_in_the_order():
    found = {f.relative_to(ROOT / "converters").with_suffix("").parts[0] for f in sources(ROOT / "converters")}
    assert found - {"__init__"} == set(CONVERTER_LAYERS)


def test_the_order_of_the_converter_is_that_of_the_document():
    text = (ROOT / "docs" / "design" / "architecture.md").read_text(encoding="utf-8")
    section = text.split("## Layers of the converter")[1].split("\n## ")[0]
    named = [name for name in re.findall(r"`(\w+)`", section) if name in CONVERTER_LAYERS]
    assert list(dict.fromkeys(named)) == CONVERTER_LAYERS


def test_imports_of_the_converter_run_downwards_only():
    """Also those that only type checkers see."""
    wrong = []
    for file in sources(ROOT / "converters"):
        layer = file.relative_to(ROOT / "converters").with_suffix("").parts[0]
        if layer == "__init__":
            continue
        for line, name in imports_of(file, typing_too=True):
            parts = name.split(".")
            if parts[0] != "ig2mj_converters":
                continue
            if len(parts) < 2 or parts[1] not in CONVERTER_LAYERS:
                wrong.append(f"{file.relative_to(ROOT)}:{line}: imports {name} from the public surface")
            elif CONVERTER_LAYERS.index(parts[1]) > CONVERTER_LAYERS.index(layer):
                wrong.append(f"{file.relative_to(ROOT)}:{line}: {layer} imports {name}")
    assert not wrong, "\n".join(wrong)


def test_no_module_imports_itself_by_way_of_others():
    graph = networkx.DiGraph()
    names = modules()
    for name, file in names.items():
        for _, expected in imports_of(file):
            found = expected if expected in names else expected.rpartition(".")[0]
            if found in names and found != name:
                graph.add_edge(name, found)
    assert graph.number_of_edges() > 500
    circles = [sorted(circle) for circle in networkx.strongly_connected_components(graph) if len(circle) > 1]
    assert not circles


def test_only_the_command_line_imports_converters_and_homes():
    wrong = [
        f"{file.relative_to(ROOT)}:{line}: {name}"
        for file in sources(SRC)
        if room_of(file) != "cli"
        for line, name in imports_of(file)
        if name.split(".")[0] in GUEST_NAMES
    ]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("room", FORBIDDEN)
def test_a_room_does_without_the_engines_it_must_not_know(room):
    wrong = [
        f"{file.relative_to(ROOT)}:{line}: {name}"
        for file in sources(SRC / room)
        for line, name in imports_of(file)
        if name.split(".")[0] in FORBIDDEN[room]
    ]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("guest", GUESTS)
def test_guest_packages_import_no_more_of_ig2mj_than_they_may(guest):
    allowed = GUESTS[guest]
    wrong = [
        f"{file.relative_to(ROOT)}:{line}: {name}"
        for file in sources(ROOT / guest)
        for line, name in imports_of(file)
        if name.split(".")[0] == "ig2mj" and not any(name == a or name.startswith(a + ".") for a in allowed)
    ]
    assert not wrong, "\n".join(wrong)


def pyproject() -> dict:
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


DATA_PACKAGES = ("ig2mj_demonstrations", "ig2mj_episodes", "ig2mj_policies", "ig2mj_pools", "ig2mj_scenes")
"""Homes, policies and demonstrations that ship: packed as they are, no Python among them."""


def packed_folders() -> dict[str, pathlib.Path]:
    """Package name -> folder, for each folder with Python files under the roots that pyproject.toml maps."""
    found = {}
    for package, root in pyproject()["tool"]["setuptools"]["package-dir"].items():
        for file in sources(ROOT / root):
            parts = file.parent.relative_to(ROOT / root).parts
            found[".".join([package, *parts])] = file.parent
    return found


def test_the_package_list_of_pyproject_is_complete():
    listed = pyproject()["tool"]["setuptools"]["packages"]
    assert sorted(listed) == sorted([*packed_folders(), *DATA_PACKAGES])


def test_every_package_has_an_init_file():
    assert [str(f) for f in packed_folders().values() if not (f / "__init__.py").is_file()] == []


def test_every_data_file_is_packed():
    patterns = pyproject()["tool"]["setuptools"]["package-data"]
    left_out = []
    for name, folder in packed_folders().items():
        root = name.split(".")[0]
        top = ROOT / pyproject()["tool"]["setuptools"]["package-dir"][root]
        for file in folder.iterdir():
            if file.is_file() and file.suffix not in (".py", ".pyc", ".pyi"):
                relative = file.relative_to(top).as_posix()
                expected = [p for p in patterns.get(root, []) if fnmatch.fnmatch(relative, p.removeprefix("**/"))]
                if not expected:
                    left_out.append(file.relative_to(ROOT).as_posix())
    assert not left_out


def test_a_module_has_one_responsibility():
    """A hint more than a rule: past 400 lines look for a second responsibility, past these bounds there is one."""
    long, busy = {}, {}
    for file in sources(SRC, ROOT / "converters", ROOT / "homes"):
        where = file.relative_to(ROOT).as_posix()
        if (lines := len(file.read_text(encoding="utf-8").splitlines())) > MOST_LINES:
            long[where] = lines
        own = {name.rpartition(".")[0] for _, name in imports_of(file) if name.startswith("ig2mj")}
        if len(own) > MOST_COLLABORATORS and where.removeprefix("src/ig2mj/") not in REGISTRIES:
            busy[where] = len(own)
    assert not long, f"look for the second responsibility in {long}"
    assert not busy, f"these know too many modules: {busy}"
