"""BEHAVIOR-1K's definitions and taxonomy (bddl 3.6.0, MIT), fetched once into the user's cache.

bddl 1.0.1 and 3.6.0 cannot be installed together, and ig2mj needs the former's taxonomy. So the source package is
downloaded by pip, which checks its hash, and only definitions, hierarchy and licence are unpacked. None of its code
stays, and nothing of it is imported.
"""

from __future__ import annotations

import functools
import hashlib
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tarfile
import tempfile

import platformdirs

from ig2mj.errors import InputError, MissingDependencyError

VERSION = "3.6.0"
SHA256 = "81d40ab7a32769828ecad3110c7db5e40e26cfb29b1158b3448a6ccb91e5d386"
"""Of `bddl-3.6.0.tar.gz`, the source package."""
HIERARCHY = "output_hierarchy.json"
LICENCE = "LICENSE"
FETCH = "ig2mj activity fetch"


def folder() -> pathlib.Path:
    """Where the files lie once they are fetched (IG2MJ_CACHE_DIR moves it)."""
    root = os.environ.get("IG2MJ_CACHE_DIR") or platformdirs.user_cache_dir("ig2mj")
    return pathlib.Path(root) / f"bddl-{VERSION}"


def definitions() -> pathlib.Path:
    """The folder with `<activity>/problem0.bddl`.

    Raises:
      MissingDependencyError: not fetched yet; the message names the command.
    """
    found = folder() / "activity_definitions"
    if not found.is_dir():
        raise MissingDependencyError(f"BEHAVIOR-1K's definitions are not on this machine (run `{FETCH}`)")
    return found


def fetch() -> pathlib.Path:
    """Downloads the source package by pip and unpacks what is needed; the folder. Does nothing where it is there.

    Raises:
      InputError: pip failed, or the package is not the one that is expected.
    """
    target = folder()
    if (target / "activity_definitions").is_dir():
        return target
    target.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=target.parent, prefix=f".{target.name}-") as name:
        work = pathlib.Path(name)
        archive = _download(work)
        unpack(archive, work / "unpacked")
        shutil.rmtree(target, ignore_errors=True)
        (work / "unpacked").rename(target)
    return target


def unpack(archive: pathlib.Path, target: pathlib.Path, sha256: str = SHA256) -> None:
    """Writes definitions, hierarchy and licence of the source package into `target`.

    Raises:
      InputError: the archive's hash is another.
    """
    found = hashlib.sha256(archive.read_bytes()).hexdigest()
    if found != sha256:
        raise InputError(archive, f"has the SHA-256 {found}, not {sha256}", fix=f"try `{FETCH}` again")
    with tarfile.open(archive) as tar:
        for member in tar:
            path = pathlib.PurePosixPath(member.name)
            inner = path.parts[1:]
            match inner:
                case ("bddl", "activity_definitions", activity, file) if file.endswith(".bddl"):
                    place = target / "activity_definitions" / activity / file
                case ("bddl", "generated_data", file) if file == HIERARCHY:
                    place = target / file
                case (file,) if file == LICENCE:
                    place = target / file
                case _:
                    continue
            content = tar.extractfile(member)
            if content is None or not place.resolve().is_relative_to(target.resolve()):
                continue
            place.parent.mkdir(parents=True, exist_ok=True)
            place.write_bytes(content.read())


def _download(work: pathlib.Path) -> pathlib.Path:
    requested = work / "requirements.txt"
    requested.write_text(f"bddl=={VERSION} --hash=sha256:{SHA256}\n", encoding="utf-8")
    arguments = ["download", "--quiet", "--disable-pip-version-check", "--no-deps", "--no-binary", "bddl"]
    arguments += ["--require-hashes", "--dest", str(work), "--requirement", str(requested)]
    done = subprocess.run([*_pip(), *arguments], capture_output=True, text=True, check=False)
    found = sorted(work.glob("bddl-*.tar.gz"))
    if done.returncode or not found:
        lines = [line for line in done.stderr.splitlines() if line.strip()]
        said = lines[-1] if lines else "it says nothing"
        raise InputError(
            f"bddl {VERSION}", f"pip cannot download it: {said}", fix="check the network and pip's settings"
        )
    return found[0]


def _pip() -> list[str]:
    """pip of this environment, or, where it has none, one that uv runs."""
    if subprocess.run([sys.executable, "-m", "pip", "--version"], capture_output=True, check=False).returncode == 0:
        return [sys.executable, "-m", "pip"]
    if uv := shutil.which("uv"):
        return [uv, "tool", "run", "pip"]
    raise MissingDependencyError(f"pip is not installed for {sys.executable} (python -m ensurepip)")


@functools.cache
def hierarchy() -> dict[str, tuple[tuple[str, ...], tuple[str, ...]]]:
    """Synset of BEHAVIOR-1K -> the synsets right above it, and its own categories. Raises as `definitions`."""
    definitions()
    parents: dict[str, dict[str, None]] = {}
    categories: dict[str, tuple[str, ...]] = {}
    stack = [json.loads((folder() / HIERARCHY).read_bytes())]
    while stack:
        node = stack.pop()
        parents.setdefault(node["name"], {})
        categories[node["name"]] = tuple(node.get("categories") or ())
        for child in node.get("children", ()):
            parents.setdefault(child["name"], {})[node["name"]] = None
            stack.append(child)
    return {name: (tuple(sorted(above)), categories[name]) for name, above in parents.items()}
