"""A world that went wrong in `soak.py`, kept in a file, and run again by C MuJoCo."""

from __future__ import annotations

import dataclasses
import functools
import json
import pathlib
from typing import Any

import mujoco
import numpy as np
from rich.console import Console

import ig2mj
from benchmarks.soak.watch import House
from ig2mj.agents.floating_hand import add_floating_hand
from ig2mj.engine.native.engine import NativeEngine
from ig2mj.engine.snapshot import Snapshot
from ig2mj.worlds.archive import build, read_arrays, read_header, save_tree
from ig2mj.worlds.guards import TOP_SPEED

DEEP = 0.005
"""Metres that geoms overlap from which on a contact is listed."""


@dataclasses.dataclass
class Dump:
    """One world.

    Attributes:
      home, start: scene and where its hand was put (m). report: what went wrong.
      row: the world before. ctrl: controls since, one row for each control step [S, nu].
    """

    home: str
    start: tuple[float, ...]
    report: dict[str, Any]
    row: Snapshot
    ctrl: np.ndarray

    def save(self, file: pathlib.Path) -> None:
        """Writes it to an npz file."""
        header = json.dumps({"home": self.home, "start": [float(x) for x in self.start], "report": self.report})
        save_tree(file, {"row": self.row, "controls": self.ctrl}, {"kind": "soak", "note": header})

    @classmethod
    def load(cls, file: pathlib.Path) -> Dump:
        """Reads what `save` wrote."""
        header = json.loads(read_header(file)["note"])
        row = build(Snapshot, read_arrays(file, "row."), file)
        controls = read_arrays(file, "controls")[""]
        return cls(header["home"], tuple(header["start"]), header["report"], row, controls)


def replay(file: pathlib.Path) -> list[dict[str, Any]]:
    """Runs a dump on the native engine and prints when its object is fast or outside, and deep contacts before.

    Returns:
      One entry for each control step: speed (m/s) and place (m) of the object, its deepest overlaps by geom (m).
    """
    dump, console = Dump.load(file), Console()
    scene = ig2mj.load_scene(dump.home, [functools.partial(add_floating_hand, pos=dump.start)])
    house, number = House.of(scene, dump.start), scene.object_index(dump.report["object"])
    engine = NativeEngine(scene)
    physics = engine.load(engine.reset(), dump.row)
    console.print(f"{dump.home}: {dump.report}")
    steps = []
    for k, ctrl in enumerate(dump.ctrl):
        physics, view = engine.step(physics, ctrl[None].astype(float))
        model, data = engine.to_mujoco(physics, 0)
        place, speed = view.object_com[0, number], float(np.linalg.norm(view.object_linvel[0, number]))
        overlaps = _overlaps(model, data, np.flatnonzero(scene.tables.geom_object == number))
        out = float(house.lost(place)) > 0
        steps.append({"speed": speed, "place": place.tolist(), "overlaps": overlaps})
        if overlaps or out or speed > TOP_SPEED / 4:
            words = ", ".join(f"{name} {1e3 * depth:.0f} mm" for name, depth in overlaps.items())
            console.print(f"{k:4d} {speed:6.2f} m/s at {np.round(place, 2)} {'OUTSIDE ' if out else ''}{words}")
    return steps


def _overlaps(model: mujoco.MjModel, data: mujoco.MjData, geoms: np.ndarray) -> dict[str, float]:
    """Geoms that the object's geoms reach into by more than `DEEP`, with the depth in metres."""
    found: dict[str, float] = {}
    for pair, dist in zip(data.contact.geom, data.contact.dist, strict=True):
        mine = np.isin(pair, geoms)
        if dist < -DEEP and mine.any():
            name = model.geom(int(pair[1 if mine[0] else 0])).name
            found[name] = max(found.get(name, 0.0), -float(dist))
    return found
