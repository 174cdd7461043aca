"""`ig2mj convert dataset`: all scenes and all objects of a dataset, one job each."""

from __future__ import annotations

import dataclasses
import hashlib
import io
import json as form
import pathlib
import shutil
import sys
import tarfile
import tempfile
from collections.abc import Mapping
from typing import Annotated, Any

import tyro

from ig2mj.cli.common.conversion import DEFAULTS, Common, Flag, options_of
from ig2mj.cli.common.jobs import Cluster, Resume, follow, opened, tell_failures, where_of
from ig2mj.files.unfinished import unfinished

MARK = "manifest.json"
"""The file that every finished folder of the output has."""


def convert_dataset(
    dataset: Annotated[pathlib.Path, tyro.conf.Positional, tyro.conf.arg(metavar="ROOT")],
    out: pathlib.Path,
    only: tuple[str, ...] = (),
    skip_missing: Flag = False,
    fixed_furniture: Flag = False,
    cluster: Cluster = None,
    resume: Resume = False,
    common: Annotated[Common, tyro.conf.OmitArgPrefixes] = DEFAULTS,
) -> int:
    """Convert all scenes and all objects of a dataset: OUT/scenes/NAME and OUT/objects/CATEGORY/MODEL.

    Models and scenes that cannot be converted are listed with the reason, and the others are still converted. Exit
    status: 0 all converted; 1 some failed; 2 bad input.

    Args:
      dataset: root of the dataset (holds objects/, scenes/ and metadata/); on a cluster every machine must see it
        under this path.
      out: output folder; earlier results there are replaced.
      only: convert only these, e.g. scenes/Rs_int, objects/apple or objects/apple/00_0.
      skip_missing: leave out models that a scene uses but the dataset lacks.
      fixed_furniture: fix cabinets, shelves, tables and desks to the floor, as BEHAVIOR does.
      cluster: run on a Ray cluster: its address, or auto.
      resume: continue an interrupted run.
    """
    from ig2mj.cluster.job_runner import map_jobs
    from ig2mj.cluster.jobs import Job, JobSet
    from ig2mj.errors import InputError

    root = dataset.resolve()
    names = [name for name in names_of(str(root)) if not only or any(f"{name}/".startswith(f"{o}/") for o in only)]
    if not names:
        what = "has nothing that --only names" if only else "holds neither scenes nor objects"
        raise InputError(dataset, what, fix="give the root of a dataset, with scenes/ or objects/ in it")
    if out.exists() and not out.is_dir():
        raise InputError(out, "is a file", element="--out", fix="name a folder")
    where = where_of(common.jobs or 1, cluster, resume)
    options_of(common)  # bad numbers are refused before any work
    out.mkdir(parents=True, exist_ok=True)
    chosen = {"skip_missing": skip_missing, "fixed_furniture": fixed_furniture}
    settings = {**dataclasses.asdict(common), "jobs": 1, "json": False}
    jobs = [Job(name, {"root": str(root), "name": name, "common": settings, "chosen": chosen}) for name in names]
    check = ("ig2mj.cli.convert_dataset:digest_of", {"root": str(root)})
    title = f"converting {root.name}"
    work = JobSet("ig2mj.cli.convert_dataset:convert_job", title, jobs, check=check)
    request = {"command": "convert dataset", "dataset": str(root), "names": names, "options": settings | chosen}

    def deliver(name: str, packed: bytes) -> None:
        put_folder(out / name, packed)

    def there(name: str) -> bool:
        return (out / name / MARK).is_file()

    with opened(out, request, where, deliver, there=there) as journal, follow(title) as report:
        _, failed = map_jobs(work, where, journal, report)
        if not failed:
            journal.finish()
    done = len(names) - len(failed)
    if common.json:
        print(form.dumps({"out": str(out), "converted": done, "failed": failed}))
    else:
        print(f"{out}: {done} of {len(names)} scenes and objects converted")
    tell_failures(failed, len(names))
    if failed and not done:
        print("nothing could be converted: is this the root of a dataset in iGibson's layout?", file=sys.stderr)
    return 1 if failed else 0


def names_of(root: str) -> list[str]:
    """All scenes and objects below a root, as scenes/NAME and objects/CATEGORY/MODEL."""
    top = pathlib.Path(root)
    scenes = [f"scenes/{folder.parent.name}" for folder in top.glob("scenes/*/urdf") if folder.is_dir()]
    objects = {
        f"objects/{file.parent.parent.name}/{file.parent.name}"
        for file in top.glob("objects/*/*/*.urdf")
        if file.stem.removesuffix("_simplified") == file.parent.name
    }
    return sorted(scenes) + sorted(objects)


def digest_of(root: str) -> str:
    """Digest of the names of all scenes and objects and the sizes of their URDFs, to compare datasets of machines.

    Raises:
      InputError: the dataset does not exist.
    """
    from ig2mj.errors import InputError

    names = names_of(root)
    if not names:
        raise InputError(root, "this dataset is missing or empty")
    files = sorted(f for name in names for f in (pathlib.Path(root) / name).rglob("*.urdf"))
    listing = "\n".join([*names, *(f"{f.relative_to(root)} {f.stat().st_size}" for f in files)])
    return hashlib.blake2b(listing.encode(), digest_size=12).hexdigest()


def convert_job(root: str, name: str, common: Mapping[str, Any], chosen: Mapping[str, Any]) -> bytes:
    """Converts one scene or object; the folder as a tar archive, the same bytes every time. Raises InputError."""
    from ig2mj_converters.conversion import convert_object, convert_scene

    kind, *rest = name.split("/")
    own = chosen if kind == "scenes" else {}
    options = dataclasses.replace(options_of(Common(**common), **own), timed=False)
    with tempfile.TemporaryDirectory(prefix="ig2mj-") as scratch:
        folder = pathlib.Path(scratch) / "out"
        if kind == "scenes":
            convert_scene(root, rest[0], folder, options=options)
        else:
            category, model = rest
            models = pathlib.Path(root) / name
            urdf = next(f for end in ("", "_simplified") if (f := models / f"{model}{end}.urdf").is_file())
            convert_object(urdf, category, folder, model=model, options=options)
        return packed_folder(folder)


def packed_folder(folder: pathlib.Path) -> bytes:
    """All files of a folder as a tar archive, without owners and times."""

    def plain(info: tarfile.TarInfo) -> tarfile.TarInfo:
        info.mtime = info.uid = info.gid = 0
        info.uname = info.gname = ""
        info.mode = 0o755 if info.isdir() else 0o644
        return info

    with io.BytesIO() as out:
        with tarfile.open(fileobj=out, mode="w") as archive:
            for file in sorted(folder.rglob("*")):
                archive.add(file, file.relative_to(folder).as_posix(), recursive=False, filter=plain)
        return out.getvalue()


def put_folder(target: pathlib.Path, packed: bytes) -> None:
    """Unpacks a folder under a temporary name, and renames it when it is complete. Raises OSError."""
    target.parent.mkdir(parents=True, exist_ok=True)
    unpacked = unfinished(target)
    try:
        with tarfile.open(fileobj=io.BytesIO(packed)) as archive:
            archive.extractall(unpacked, filter="data")
        if target.exists():
            shutil.rmtree(target)
        unpacked.replace(target)
    except OSError:
        shutil.rmtree(unpacked, ignore_errors=True)
        raise
