"""Tasks with objects of one's own in their home.

env = ig2mj.make("CookingMeat", objects=["obj/mug@on_top:breakfast_table_0"])
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Sequence

from ig2mj.errors import Ig2mjError
from ig2mj.scene.additions import name_additions
from ig2mj.scene.changes import added, read_change
from ig2mj.scene.extras import is_extra
from ig2mj.scene.library import LibraryName, find_model
from ig2mj.scene.manifest import load_manifest
from ig2mj.scene.object_requests import read_request
from ig2mj.scene.paths import scene_folder
from ig2mj.scene.scene import Objects
from ig2mj.scene.substance_requests import is_substances
from ig2mj.tasks.bddl.task import BddlTask
from ig2mj.tasks.homes import AnyTask
from ig2mj.tasks.registry import TASKS
from ig2mj.tasks.task import Task


def with_objects(task: AnyTask, objects: Objects) -> AnyTask:
    """The task in its home with these objects, as of `load_scene`.

    In an activity of `Task` a predicate such as "@on_top:breakfast_table_0" is a further condition of the start states:
    each of them has the object in another place. In other tasks it is placed once. "remove:NAME" and
    "replace:NAME=MODEL" change the home.

    Raises:
      UnknownNameError: there is no such object. Ig2mjError: a place is none.
    """
    if task.name in TASKS and not isinstance(task, BddlTask):
        task = dataclasses.replace(task, objects=tuple(map(LibraryName, task.objects)))
    references = object_texts(objects)
    if not references:
        return task
    if not isinstance(task, Task):
        return dataclasses.replace(task, added=references)
    texts = added(references)
    changes = [text for text in references if text not in texts]
    requested = [read_request(text) for text in texts]
    pairs = list(zip(requested, texts, strict=True))
    bare = [text if request.predicate is None else text.rpartition("@")[0] for request, text in pairs]
    taken = (o.name for o in load_manifest(scene_folder(task.home)).objects)
    names = [name for name, _ in name_additions(taken, [*task.objects, *bare])][len(task.objects) :]
    start = [
        f"({request.predicate[0]} {name} {request.predicate[1]})"
        for request, name in zip(requested, names, strict=True)
        if request.predicate is not None
    ]
    return dataclasses.replace(task, objects=(*task.objects, *bare, *changes), start=(*task.start, *start))


def object_texts(objects: Objects) -> tuple[str, ...]:
    """The texts of objects, folders with their whole paths.

    Raises:
      UnknownNameError: there is no such object. Ig2mjError: one of them is none.
    """
    if not isinstance(objects, str | os.PathLike | Sequence):
        raise Ig2mjError(f"objects = {objects!r}: a folder or a name of the object library, or a list of them")
    return tuple(map(_text, (objects,) if isinstance(objects, str | os.PathLike) else objects))


def _text(requested: str | os.PathLike) -> str:
    if (change := read_change(requested)) is not None:
        return change.canonical.text
    if is_substances(requested) or is_extra(requested):
        return str(requested)
    request = read_request(requested)
    model = find_model(request.reference)
    return f"{model.reference}{request.text[len(request.reference) :]}" if model.named else request.text
