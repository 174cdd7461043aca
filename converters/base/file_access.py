"""Which files a URDF may make the converter read.

A file name inside a URDF, MTL, DAE or glTF is untrusted input. `FileGuard` resolves it and refuses paths outside the
allowed folders, after following symbolic links.
"""

from __future__ import annotations

import os
import pathlib
import re
import urllib.parse
from collections.abc import Sequence

from ig2mj.errors import InputError
from ig2mj.files.inside import OutsideError

from . import inputs
from .xml_reader import read_xml, shortened

PACKAGE_SEARCH_DEPTH = 8  # how many folders above an URDF are looked at for its ROS package
_SCHEME = re.compile(r"([A-Za-z][A-Za-z0-9+.-]+)://")
_FIND = re.compile(r"(?:file://)?\$\(\s*find\s+([^()]+?)\s*\)/*")
"""A package's folder as xacro and roslaunch write it."""


class FileGuard:
    """Resolves the file names of one URDF.

    Attributes:
      file: the URDF, for messages.
      folder: what relative names start from.
      roots: resolved folders below which files may be read; None: anywhere.
      dataset: dataset mode: names must be relative and without `package://`.

    Args:
      mesh_root: another folder below which files may be read, as `../sibling/meshes` needs.
      package_path: folders that hold packages, or are one: looked at first for `package://name/...`, and the only ones
        (with `mesh_root` and the URDF's own package) for `package:///...`, which names no package.
    """

    def __init__(
        self,
        file: str | os.PathLike,
        root: str | os.PathLike | None = None,
        folder: str | os.PathLike | None = None,
        allow_outside: bool = False,
        *,
        mesh_root: str | os.PathLike | None = None,
        package_path: Sequence[str | os.PathLike] = (),
    ):
        self.file = pathlib.Path(file)
        self.folder = pathlib.Path(folder) if folder is not None else self.file.parent
        self.dataset = root is not None
        self._packages: list[pathlib.Path] = []
        if root is not None:
            self.roots: list[pathlib.Path] | None = [pathlib.Path(root).resolve()]
        elif allow_outside:
            self.roots = None
        else:
            self.roots = [self.folder.resolve()]
            if (package := package_root(self.file.parent)) is not None:
                self.roots.append(package)
            self._packages = [_folder(p, "--package-path") for p in package_path]
            if mesh_root is not None:
                self._packages.append(_folder(mesh_root, "--mesh-root"))
            self.roots += self._packages

    def resolve(self, filename: str, element: str, base: pathlib.Path | None = None) -> pathlib.Path:
        """Path of a file that is named in the URDF, or in a file in the folder `base`.

        A name with percent signs that is no file is read as the percent-encoding of one, as URIs have it; so is the
        name of a package. `$(find package)/`, which xacro leaves in a file that it has not expanded, is `package://`.
        The path need not exist. Raises OutsideError where it may not be read, InputError for names that are none.
        """
        path = self._resolve(filename, element, base)
        if "%" in filename and not inputs.is_file(path):
            plain = urllib.parse.unquote(filename, errors="replace")
            if plain != filename:
                return self._resolve(plain, element, base)
        return path

    def _resolve(self, filename: str, element: str, base: pathlib.Path | None) -> pathlib.Path:
        name = _FIND.sub(r"package://\1/", filename.strip().replace("\\", "/"), count=1)
        said = shortened(name)
        if not name or any(ord(c) < 32 for c in name):
            raise InputError(self.file, f"{shortened(filename)!r} is not a file name", element=element)
        scheme = _SCHEME.match(name)
        if scheme and self.dataset:
            raise OutsideError(self.file, f"'{said}' is not below the dataset root", element=element)
        if scheme and scheme[1] in ("package", "model"):
            path = self._in_package(name[scheme.end() :], element)
        elif scheme and scheme[1] == "file":
            path = pathlib.Path(urllib.parse.unquote(name[scheme.end() :]))
        elif scheme:
            raise OutsideError(self.file, f"'{said}' is an address, not a local file", element=element)
        else:
            if self.dataset and (name.startswith("/") or re.match(r"[A-Za-z]:", name)):
                raise OutsideError(
                    self.file, f"'{said}' is absolute", element=element, fix="name it relative to the model's folder"
                )
            path = (base or self.folder) / name
        try:
            real = inputs.real_path(path)
        except (OSError, RuntimeError) as e:
            raise InputError(self.file, f"'{said}' cannot be resolved: {e}", element=element) from e
        if self.roots is not None and not any(real.is_relative_to(root) for root in self.roots):
            where = "the dataset root" if self.dataset else "the URDF's folder and its package"
            fix = "move the file inside" if self.dataset else "move the file inside, or name its folder by --mesh-root"
            raise OutsideError(self.file, f"'{said}' lies outside {where}", element=element, fix=fix)
        return real

    def _in_package(self, rest: str, element: str) -> pathlib.Path:
        package, _, inside = rest.partition("/")
        if not package and self._packages:
            own = package_root(self.file.parent)
            folders = [*self._packages, *([] if own is None else [own])]
            return next((f / inside for f in folders if inputs.is_file(f / inside)), folders[0] / inside)
        if package in ("", ".", ".."):
            fix = "name the package's folder by --package-path" if not package else ""
            raise InputError(self.file, f"'package://{shortened(rest)}' names no package", element=element, fix=fix)
        names = dict.fromkeys((package, urllib.parse.unquote(package, errors="replace")))
        names = [n for n in names if n not in ("", ".", "..") and "/" not in n and "\\" not in n and n.isprintable()]
        root = next((r for n in names if (r := self._on_path(n) or find_package(self.file.parent, n))), None)
        if root is None:
            raise InputError(
                self.file,
                f"no folder above it is the package '{shortened(package)}'",
                element=element,
                fix="put the URDF into the package's folder, with a package.xml, or name it by --package-path",
            )
        neighbours = [self.file.parent.resolve() / n for n in names]
        if (
            self.roots is not None
            and root not in self.roots
            and not any(b.is_symlink() or b == root for b in neighbours)
        ):
            self.roots.append(root)
        return root / inside

    def _on_path(self, package: str) -> pathlib.Path | None:
        for folder in self._packages:
            if folder.name == package or _package_name(folder / "package.xml") == package:
                return folder
            if inputs.is_folder(folder / package):
                return inputs.real_path(folder / package)
        return None


def _folder(path: str | os.PathLike, option: str) -> pathlib.Path:
    if not inputs.is_folder(path):
        raise InputError(path, "is not a folder", element=option)
    return inputs.real_path(path)


def package_root(folder: pathlib.Path) -> pathlib.Path | None:
    """The ROS package an URDF's folder belongs to: the nearest folder with a package.xml, or, where the folder is
    called urdf, robots or xacro, the folder above it. Resolved; None where there is none."""
    folder = folder.resolve()
    for candidate in _upwards(folder):
        if inputs.is_file(candidate / "package.xml"):
            return candidate
    if folder.name in ("urdf", "urdfs", "robots", "xacro") and _is_private(folder.parent):
        return folder.parent
    return None


def find_package(folder: pathlib.Path, package: str) -> pathlib.Path | None:
    """The folder that `package://<package>/` means, seen from a folder inside it or next to it.

    First a folder of that name next to the URDF, as Bullet has it. Then walking up: a folder with a package.xml of that
    name, a folder of that name, or a neighbour of that name with a package.xml.
    """
    if inputs.is_folder(folder / package):
        return (folder / package).resolve()
    for candidate in _upwards(folder.resolve()):
        manifest = candidate / "package.xml"
        if inputs.is_file(manifest) and _package_name(manifest) == package:
            return candidate
        if candidate.name == package:
            return candidate
        neighbour = candidate / package
        if inputs.is_file(neighbour / "package.xml"):
            return neighbour.resolve()
    return None


def _upwards(folder: pathlib.Path) -> list[pathlib.Path]:
    return [f for f in [folder, *folder.parents][:PACKAGE_SEARCH_DEPTH] if _is_private(f)]


def _is_private(folder: pathlib.Path) -> bool:
    """Not a folder that holds everything: the file system's root, its direct children, homes and what is above."""
    try:
        home = pathlib.Path.home().resolve()
    except RuntimeError:
        home = pathlib.Path("/")
    return len(folder.parts) > 2 and not home.is_relative_to(folder)


def _package_name(manifest: pathlib.Path) -> str | None:
    try:
        name = read_xml(manifest, "package", limit=2**20).find("name")
    except InputError:
        return None
    return None if name is None else (name.text or "").strip()
