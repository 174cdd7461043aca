"""Renders the images of docs/guide/gallery.md and of the README into docs/images: `make gallery`.

python scripts/gallery.py [rooms|homes|robots|states|night ...]
"""

from __future__ import annotations

import dataclasses
import pathlib
import sys

import mujoco
import numpy as np
from PIL import Image

import ig2mj
from ig2mj.agents.registry import make_robot
from ig2mj.looks import visual_of
from ig2mj.scene.manifest import load_manifest
from ig2mj.scene.paths import SHIPPED_HOMES, shipped_homes
from ig2mj.scene.rooms import load_rooms
from ig2mj.scene.scene import Scene, load_scene
from ig2mj.sensors.native_camera import NativeCamera
from ig2mj.viewer.captions import caption
from ig2mj.viewer.offscreen import FreeView, render
from ig2mj.viewer.overview import home_overview
from ig2mj.viewer.room_views import room_view

FOLDER = pathlib.Path(__file__).resolve().parents[1] / "docs" / "images"
TILE, QUALITY = (400, 300), 84


def main() -> None:
    parts = {
        "rooms": rooms,
        "homes": homes,
        "robots": robots,
        "states": states,
        "substances": substances,
        "night": night,
    }
    for name in sys.argv[1:] or parts:
        parts[name]()
        print(name, flush=True)


def rooms() -> None:
    """The largest room of each type over all homes, and a living room for the README."""
    best: dict[str, tuple[float, str, str]] = {}
    for home in shipped_homes():
        rooms = load_rooms(SHIPPED_HOMES / home)
        for k, (name, kind) in enumerate(zip(rooms.names, rooms.types, strict=True)):
            area = float((rooms.room_map == k + 1).sum()) * rooms.resolution**2
            if area > best.get(kind, (0.0, "", ""))[0]:
                best[kind] = area, home, name
    tiles = []
    for kind, (_, home, name) in sorted(best.items()):
        scene = load_scene(home)
        tiles.append(tile(scene, room_view(scene, name), f"{kind.replace('_', ' ')} ({home})"))
    sheet(tiles, 4).save(FOLDER / "gallery_rooms.jpg", quality=QUALITY)
    scene = load_scene("birch")
    view = dataclasses.replace(room_view(scene, "living_room_0"), fovy=56.0)
    tile(scene, view, "", (960, 540)).save(FOLDER / "room.jpg", quality=QUALITY)


def homes() -> None:
    """Every home from above."""
    tiles = []
    for home in shipped_homes():
        scene = load_scene(home)
        view = home_overview(scene, scene.start_data(), elevation=-58.0)
        count = len(load_manifest(SHIPPED_HOMES / home).rooms.instances)
        tiles.append(tile(scene, view, f"{home}, {count} rooms"))
    sheet(tiles, 4).save(FOLDER / "gallery_homes.jpg", quality=QUALITY)


def night() -> None:
    """Rooms by day and by night."""
    tiles = []
    for looks in ("day", "night"):
        scene = load_scene("birch", looks=looks)
        for name in ("living_room_0", "kitchen_0", "bedroom_0"):
            tiles.append(tile(scene, room_view(scene, name), looks))
    sheet(tiles, 3).save(FOLDER / "gallery_night.jpg", quality=QUALITY)


def robots() -> None:
    """The robots that ship."""
    tiles = []
    spot = {"humanoid": (1.85, 0.6), "fetch": (2.05, 0.7), "turtlebot": (1.2, 0.28)}
    for name, (distance, height) in spot.items():
        scene = load_scene("birch", [make_robot(name).at(1.7, -1.6, -1.2)])
        tiles.append(tile(scene, FreeView((1.7, -1.6, height), distance, 118.0, -16.0), name, (400, 400)))
    sheet(tiles, 3).save(FOLDER / "gallery_robots.jpg", quality=QUALITY)


def states() -> None:
    """One object in each state."""
    tiles = []
    for title, model, setting, value in (
        ("steak", "steak", None, None),
        ("hot: it steams", "steak", "temperature", 65.0),
        ("cooked", "steak", "temperature", 80.0),
        ("burnt", "steak", "temperature", 230.0),
        ("apple", "apple", None, None),
        ("frozen", "apple", "frozen", True),
        ("sliced", "apple", "sliced", True),
        ("plate", "plate", None, None),
        ("dusty", "plate", "dusty", True),
        ("stained", "plate", "stained", True),
        ("bath towel", "bath_towel", None, None),
        ("soaked", "bath_towel", "soaked", True),
    ):
        sim = ig2mj.Simulation("birch", objects=[model])
        name = next(n for n in sim.scene.object_names if n.startswith(f"{model}_") and n in sim.scene.object_names[-4:])
        top = np.asarray(sim.view.aabb_high)[0, sim.scene.object_index("coffee_table_0")]
        low = np.asarray(sim.view.aabb_low)[0, sim.scene.object_index("coffee_table_0")]
        height = np.asarray(sim.view.aabb_high - sim.view.aabb_low)[0, sim.scene.object_index(name)][2]
        for other in sim.scene.object_names:
            pose = sim.object_pose(other)[0]
            if not sim.scene.object(other).fixed and (pose[:2] > low[:2]).all() and (pose[:2] < top[:2]).all():
                sim.set_object_pose(other, (30.0 + len(tiles), 0.0, 1.0))
        at = np.array([*((low + top) / 2)[:2], top[2] + height / 2 + 0.01])
        sim.set_object_pose(name, at)
        sim.step(count=15)
        if setting == "temperature":
            sim.set_state("temperature", name, value)
            sim.step()
            if title.startswith("cooked"):
                sim.set_state("temperature", name, 30.0)
            elif title.startswith("burnt"):
                sim.set_state("temperature", name, 150.0)
        elif setting in ("dusty", "stained", "frozen", "soaked"):
            sim.set_predicate(setting, name)
        elif setting == "sliced":
            sim.set_predicate("sliced", name)
            sim.step(count=10)
        pos = np.asarray(sim.view.object_com)[0, sim.scene.object_index(name)] if setting != "sliced" else at
        view = FreeView((float(at[0]), float(at[1]), float(pos[2]) + 0.03), 0.62, 60.0, -28.0)
        tiles.append(caption(sim.render(view, width=600, height=450), title))
        del sim
    for looks, name, title, distance, elevation in (
        ("night", "floor_lamp_0", "lamp by night", 2.2, -8.0),
        ("day", "sink_0", "sink", 1.1, -38.0),
    ):
        sim = ig2mj.Simulation(load_scene("birch", looks=looks))
        index = sim.scene.object_index(name)
        low, high = (np.asarray(getattr(sim.view, side))[0, index] for side in ("aabb_low", "aabb_high"))
        at, turn = (low + high) / 2, np.degrees(np.arctan2(*into_room(sim, index)[::-1])) + 180.0
        view = FreeView((float(at[0]), float(at[1]), float(high[2]) - 0.25), distance, turn + 20.0, elevation)
        for on in (False, True):
            sim.set_predicate("toggled_on", name, value=on)
            sim.step(count=30)
            words = title + ", on" * on
            tiles.append(caption(sim.render(view, width=600, height=450), words))
        del sim
    small = [Image.fromarray(t).resize((300, 225), Image.Resampling.LANCZOS) for t in tiles]
    sheet([np.asarray(image) for image in small], 4).save(FOLDER / "gallery_states.jpg", quality=QUALITY)


def substances() -> None:
    """Milk in a bowl, and a table with mud on which a newspaper burns: for people, and in cameras of robots."""
    names = ["water", "milk", "mud"]
    sim = ig2mj.Simulation(load_scene("birch", objects=["newspaper", "with:on_fire"], substances=names))
    for condition in (
        ("on_top", "newspaper_0", "coffee_table_0"),
        ("filled", "bowl_0", "milk"),
        ("covered", "coffee_table_0", "mud"),
        ("on_fire", "newspaper_0"),
    ):
        sim.set_predicate(*condition)
    tiles, seen = [], []
    name = sim.scene.model.camera(0).name
    camera = NativeCamera(sim.engine, sim.state_model, [name], width=480, height=360, looks="day")
    for thing, distance, elevation in (("bowl_0", 0.6, -40.0), ("newspaper_0", 1.2, -20.0)):
        at = np.asarray(sim.view.object_com)[0, sim.scene.object_index(thing)]
        view = FreeView((float(at[0]), float(at[1]), float(at[2])), distance, 120.0, elevation)
        tiles.append(sim.render(view, width=480, height=360))
        images = camera(sim.physics, sim.view, sim.states, {name: eye(at, distance, 120.0, elevation)})
        seen.append(caption(np.asarray(images.rgb)[0, 0], "camera of a robot"))
    camera.close()
    sheet([*tiles, *seen], 2).save(FOLDER / "gallery_substances.jpg", quality=QUALITY)


def eye(at: np.ndarray, distance: float, azimuth: float, elevation: float) -> tuple[np.ndarray, np.ndarray]:
    """Pose [1, 3] and [1, 4] of a camera that stands as a `FreeView` does."""
    a, e = np.radians(azimuth), np.radians(elevation)
    back = -np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, np.stack([right, np.cross(back, right), back], axis=1).ravel())
    return (at + distance * back)[None], quat[None]


def into_room(sim: ig2mj.Simulation, index: int) -> np.ndarray:
    """Direction [2] from an object to the middle of its room."""
    rooms = sim.scene.rooms
    assert rooms is not None
    pos = np.asarray(sim.view.object_com)[0, index][:2]
    mask = rooms.room_map == rooms.index_at(pos[None])[0] + 1
    rows, columns = np.nonzero(mask)
    middle = (np.array([columns.mean(), rows.mean()]) - mask.shape[0] / 2) * rooms.resolution
    return middle - pos


def tile(scene: Scene, view: FreeView, words: str, size: tuple[int, int] = TILE) -> Image.Image:
    """An image with words, rendered at twice its size."""
    data = scene.start_data()
    mujoco.mj_forward(scene.model, data)
    visual = visual_of(scene)
    seen = visual.data(scene.model, data)
    drawn = render(visual.model, seen, view, width=2 * size[0], height=2 * size[1])
    return Image.fromarray(caption(drawn, words)).resize(size, Image.Resampling.LANCZOS)


def sheet(tiles: list, columns: int) -> Image.Image:
    """Tiles of one size in rows."""
    images = [np.asarray(t) for t in tiles]
    rows = -(-len(images) // columns)
    blank = np.full_like(images[0], 255)
    images += [blank] * (rows * columns - len(images))
    return Image.fromarray(
        np.concatenate([np.concatenate(images[r * columns : (r + 1) * columns], 1) for r in range(rows)], 0)
    )


if __name__ == "__main__":
    main()
