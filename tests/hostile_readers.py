"""Readers of files that strangers make, each with a valid input and with mutations of it, for fuzz tests.

A reader is a function from a folder to a `Reader`. What it raises must be an `Ig2mjError`; where a page talks to a
server, a ValueError. Warnings are none of this file's business.
"""

from __future__ import annotations

import dataclasses
import io
import json
import pathlib
import warnings
from collections.abc import Callable
from typing import Any

import h5py
import numpy as np
from file_mutations import hdf5_or_bytes, json_or_bytes, lines_or_bytes, npz_or_bytes
from fuzz import mutated_bytes, mutated_json

from ig2mj.errors import Ig2mjError


@dataclasses.dataclass
class Reader:
    """`read`: takes what `mutate` makes of a seed, and raises `typed` errors alone. `valid`: what is mutated. `whole`:
    what is read without a mutation, where that is not `valid`."""

    read: Callable[[Any], Any]
    valid: Any
    mutate: Callable[[Any, int], Any] = mutated_bytes
    typed: tuple[type[BaseException], ...] = (Ig2mjError,)
    whole: Any = None

    def read_valid(self) -> None:
        """Reads the valid input, `whole` where it is not what is mutated."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            self.read(self.valid if self.whole is None else self.whole)

    def failures(self, seeds: range) -> dict[int, str]:
        """Seed -> what was raised that is no typed error, or has no one-line message."""
        found: dict[int, str] = {}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            for seed in seeds:
                try:
                    self.read(self.mutate(self.valid, seed))
                except self.typed as e:
                    if "\n" in str(e):
                        found[seed] = f"several lines: {e}"
                except Exception as e:
                    at = e.__traceback__
                    while at is not None and at.tb_next is not None:
                        at = at.tb_next
                    where = f"{at.tb_frame.f_code.co_filename}:{at.tb_lineno}" if at is not None else ""
                    found[seed] = f"{type(e).__name__} at {where}: {str(e)[:300]}"
        return found


def file_reader(file: pathlib.Path, read: Callable[[pathlib.Path], Any]) -> Callable[[bytes], Any]:
    """A reader of bytes, which are written into that file."""

    def of_bytes(raw: bytes) -> Any:
        file.write_bytes(raw)
        return read(file)

    return of_bytes


def rooms(folder: pathlib.Path) -> Reader:
    from ig2mj.scene.rooms import load_rooms

    out = io.BytesIO()
    np.savez_compressed(
        out, format_version=np.array(1), names=np.array(["a_0", "b_0"]), types=np.array(["a", "b"]),
        room_map=np.arange(9, dtype=np.int16).reshape(3, 3) % 3, resolution=np.array(0.1),
        trav_resolution=np.array(0.1), traversable=np.ones((3, 3), bool), traversable_no_obj=np.ones((3, 3), bool),
    )  # fmt: skip

    def read(file: pathlib.Path) -> None:
        found = load_rooms(file)
        found.index_at(np.array([[0.0, 0.0], [np.nan, 1.0]]))
        assert found.room_map.dtype == np.int16

    return Reader(file_reader(folder / "rooms.npz", read), out.getvalue(), npz_or_bytes)


def expressions(folder: pathlib.Path) -> Reader:
    from tiny_home import write_tiny_home

    from ig2mj.predicates import compile_expression, parse
    from ig2mj.scene.scene import load_scene
    from ig2mj.states.model import StateModel

    scene = load_scene(write_tiny_home(folder / "home"))
    model = StateModel.of_manifest(scene.tables, scene.manifest)
    names = [o for o in scene.object_names]
    valid = f"""(and (cooked {names[-1]}) (forall (?f - apple) (or (inside ?f {names[1]}) (not (frozen ?f))))
     (exists (?t - table) (forn 1 (?p - "apple") (on_top ?p ?t)))  ; a comment
     (imply (open {names[0]}) (fornpairs (2) (?c - apple) (?t - table) (next_to ?c ?t))))"""

    def read(raw: bytes) -> None:
        compile_expression(model, parse(raw.decode("utf-8", "surrogateescape")))

    return Reader(read, valid.encode())


def manifests(folder: pathlib.Path) -> Reader:
    from tiny_home import write_tiny_home

    from ig2mj.scene.scene import load_scene

    home = write_tiny_home(folder / "home")
    file = home / "manifest.json"
    return Reader(file_reader(file, lambda _: load_scene(home)), file.read_bytes(), json_or_bytes)


def models(folder: pathlib.Path) -> Reader:
    from tiny_home import write_tiny_home

    from ig2mj.scene.scene import load_scene

    home = write_tiny_home(folder / "home")
    file = home / "scene.xml"
    return Reader(file_reader(file, lambda _: load_scene(home)), file.read_bytes())


def pools(folder: pathlib.Path) -> Reader:
    import jax
    from tiny_home import write_tiny_home

    from ig2mj.engine.registry import make_engine
    from ig2mj.scene.scene import load_scene
    from ig2mj.states.initial import initial_states
    from ig2mj.states.model import StateModel
    from ig2mj.worlds.pool import Pool, load_pool, load_pool_scene, save_pool

    home = write_tiny_home(folder / "home")
    scene = load_scene(home)
    engine = make_engine("native", scene, 1)
    states = initial_states(StateModel.of_manifest(scene.tables, scene.manifest), 1)
    one = jax.tree.map(lambda a: np.asarray(a)[None], engine.export(engine.reset(), 0))
    rows = Pool(one, jax.tree.map(np.asarray, states)).rows(np.zeros(2, int))
    save_pool(rows, folder / "pool.npz", scene)

    def read(file: pathlib.Path) -> None:
        found = load_pool(file, scene)
        assert all(np.isfinite(a).all() for a in jax.tree.leaves(found.physics))
        load_pool(file)

    def read_both(file: pathlib.Path) -> None:
        read(file)
        load_pool_scene(file, home)

    return Reader(file_reader(folder / "pool.npz", read_both), (folder / "pool.npz").read_bytes(), npz_or_bytes)


ROBOT = {
    "format_version": 1,
    "name": "rover",
    "base": "base",
    "joints": [
        {"name": "left_wheel", "type": "continuous", "parent": "base", "child": "left"},
        {"name": "right_wheel", "type": "continuous", "parent": "base", "child": "right"},
        {"name": "shoulder", "type": "revolute", "parent": "base", "child": "arm", "effort": 3.0, "velocity": 1.0},
        {"name": "finger", "type": "prismatic", "parent": "arm", "child": "tip"},
        {"name": "thumb", "type": "prismatic", "parent": "arm", "child": "thumb", "mimics": "finger"},
    ],
    "frames": {
        link: {"on": "base", "pos": [0.0, 0.0, 0.0], "axes": [[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]]}
        for link in ("base", "left", "right", "arm", "tip", "thumb", "camera")
    },
}
LAYOUT = """base = "differential"
wheels = ["left_wheel", "right_wheel"]
arm = ["shoulder"]
gripper = ["finger"]
closed = "lower"
hand = "arm"
camera = "camera"
laser = ""
[start]
shoulder = 0.4
"""


ROVER = """<mujoco><compiler angle="radian"/><worldbody>
<body name="rover" pos="0 0 0.05"><freejoint/><geom type="box" size="0.2 0.15 0.03"/>
<body name="rover_left" pos="0 0.2 0" quat="0.7071068 0.7071068 0 0">
<joint name="rover_left_wheel" axis="0 0 1"/><geom type="cylinder" size="0.05 0.02"/></body>
<body name="rover_right" pos="0 -0.2 0" quat="0.7071068 0.7071068 0 0">
<joint name="rover_right_wheel" axis="0 0 1"/><geom type="cylinder" size="0.05 0.02"/></body>
<body name="rover_arm" pos="0 0 0.1"><joint name="rover_shoulder" axis="0 1 0" range="-1 1"/>
<geom type="box" size="0.02 0.02 0.1"/>
<body name="rover_tip" pos="0 0 0.1"><joint name="rover_finger" type="slide" axis="0 1 0" range="0 0.04"/>
<geom type="box" size="0.01 0.01 0.02"/></body>
<body name="rover_thumb" pos="0 0.05 0.1"><joint name="rover_thumb" type="slide" axis="0 1 0" range="0 0.04"/>
<geom type="box" size="0.01 0.01 0.02"/></body></body></body></worldbody></mujoco>"""


def robots(folder: pathlib.Path) -> Reader:
    from ig2mj.agents.urdf.assignment import find_layout
    from ig2mj.agents.urdf.body import MODEL_FILE, RobotBody
    from ig2mj.agents.urdf.description import ROBOT_FILE, Description

    (folder / MODEL_FILE).write_text(ROVER)

    def read(file: pathlib.Path) -> None:
        description = Description.load(file.parent)
        find_layout(description, RobotBody(file.parent, description))

    return Reader(file_reader(folder / ROBOT_FILE, read), json.dumps(ROBOT).encode(), json_or_bytes)


def layouts(folder: pathlib.Path) -> Reader:
    import tomllib

    from ig2mj.agents.urdf.assignment import find_layout
    from ig2mj.agents.urdf.body import MODEL_FILE, RobotBody
    from ig2mj.agents.urdf.description import ROBOT_FILE, Description
    from ig2mj.agents.urdf.layout_file import read_entries

    (folder / ROBOT_FILE).write_text(json.dumps(ROBOT))
    (folder / MODEL_FILE).write_text(ROVER)
    robot = Description.load(folder)
    body = RobotBody(folder, robot)
    toml, other = folder / "layout.toml", folder / "layout.json"

    def mutate(valid: bytes, seed: int) -> tuple[pathlib.Path, bytes]:
        if seed % 2:
            return toml, mutated_bytes(valid, seed)
        return other, json_or_bytes(json.dumps(tomllib.loads(valid.decode())).encode(), seed)

    def read(given: tuple[pathlib.Path, bytes]) -> None:
        given[0].write_bytes(given[1])
        find_layout(robot, body, read_entries(given[0]), str(given[0]))

    return Reader(read, LAYOUT.encode(), mutate, whole=(toml, LAYOUT.encode()))


def journals(folder: pathlib.Path) -> Reader:
    from ig2mj.cluster.journal import Journal

    out, request = folder / "out.npz", {"command": "sample", "count": 3, "versions": {"numpy": "2"}}
    with Journal(out, request) as journal:
        for name in ("a/0", "a/1", "a/2"):
            journal.put(name, name.encode())
    pieces = folder / "out.npz.jobs"

    def mutate(valid: dict[str, bytes], seed: int) -> dict[str, bytes]:
        name = "done.jsonl" if seed % 3 else "request.json"
        return valid | {name: lines_or_bytes(valid[name], seed)}

    def read(files: dict[str, bytes]) -> None:
        for name, raw in files.items():
            (pieces / name).write_bytes(raw)
        with Journal(out, request, resume=True) as journal:
            for name in journal.names():
                assert journal.get(name) == name.encode()
            journal.put("a/0", b"a/0")

    valid = {name: (pieces / name).read_bytes() for name in ("done.jsonl", "request.json")}
    return Reader(read, valid, mutate)


def activities(folder: pathlib.Path) -> Reader:
    from ig2mj.knowledge import bddl_folder
    from ig2mj.tasks.bddl.definitions import load_activity

    valid = (bddl_folder() / "activity_definitions" / "packing_lunches" / "problem0.bddl").read_bytes()
    return Reader(file_reader(folder / "own.bddl", load_activity), valid)


def overrides(folder: pathlib.Path) -> Reader:
    from ig2mj.knowledge.overrides import load_overrides

    valid = {
        "categories": {"apple": {"cookable": {"cook_temperature": 70.0}, "burnable": None}},
        "also_accepts": {"a": ["b"]},
    }
    return Reader(file_reader(folder / "own.json", load_overrides), json.dumps(valid).encode(), json_or_bytes)


def policies(folder: pathlib.Path) -> Reader:
    import ig2mj.learn.policies as policies
    from ig2mj.learn.shipped import shipped

    def read(file: pathlib.Path) -> None:
        policy = policies.Policy.load(file)
        spaces = _spaces(policy.card["depends"])
        policy.player(policies.perception_of(policy, spaces))

    return Reader(file_reader(folder / "policy.npz", read), shipped()["PointNavigation"].read_bytes(), npz_or_bytes)


def _spaces(depends: dict[str, Any]) -> dict[str, Any]:
    """What an environment would observe that a card describes."""
    from ig2mj.envs.observations import Space

    high = depends["picture"][0] * 4 if depends["picture"] else 128
    spaces = {name: Space((width,), np.float32, -1.0, 1.0) for name, width in depends["vector"].items()}
    spaces["rgb"] = Space((high, high, 3), np.uint8, 0.0, 255.0)
    spaces["depth"] = Space((high, high, 1), np.float32, 0.0, 5.0)
    return spaces


def demonstrations(folder: pathlib.Path) -> Reader:
    from ig2mj.demos.reader import ATTRIBUTES
    from ig2mj.demos.writer import FORMAT, FORMAT_VERSION
    from ig2mj.learn.demos import about, load_demos
    from ig2mj.learn.perception import Perception

    file = folder / "demos.h5"
    world = {"task": "reach", "robot": "", "grasping": "", "actions": ["x", "y"], "privileged": []}
    arrays = {f"steps/{name}": np.zeros((4, 2), np.float32) for name in ("action", "label")}
    arrays |= {"steps/reward/total": np.zeros(4, np.float32), "obs/proprioception": np.zeros((5, 3), np.float32)}
    arrays |= {"steps/terminated": np.array([False] * 3 + [True]), "steps/truncated": np.zeros(4, bool)}
    with h5py.File(file, "w") as out:
        out.attrs["format"], out.attrs["version"] = FORMAT, FORMAT_VERSION
        for name in ATTRIBUTES:
            out.attrs[name] = "text"
        out.attrs["task"], out.attrs["robot"], out.attrs["grasping"] = "reach", "", ""
        out.attrs["action_names"], out.attrs["privileged_names"] = '["x", "y"]', "[]"
        out.attrs["spaces"] = json.dumps({"proprioception": [[3], "float32"]})
        out.attrs["columns"], out.attrs["worlds"] = json.dumps(list(arrays)), 1
        rows = [[k if name.startswith("obs/") else k - 1 for name in arrays] for k in range(5)]
        out["index"] = np.array(rows * 2, np.int32)
        for name, values in arrays.items():
            out[name] = values
        for number in range(2):
            run = out.create_group(f"run_{number:06d}")
            run.attrs["frames"], run.attrs["world"], run.attrs["success"] = 5, 0, True
            run.attrs["parts"] = np.array([[5 * number, 5]])

    def read(file: pathlib.Path) -> None:
        _, spaces = about(file)
        load_demos(file, Perception(spaces), world)

    return Reader(file_reader(folder / "read.h5", read), file.read_bytes(), hdf5_or_bytes)


def recordings(folder: pathlib.Path) -> Reader:
    from ig2mj.demos.reader import ATTRIBUTES, Recording
    from ig2mj.demos.writer import FORMAT, FORMAT_VERSION

    file, columns = folder / "runs.h5", ["frames/physics/qpos", "frames/goal", "steps/action"]
    with h5py.File(file, "w") as out:
        out.attrs["format"], out.attrs["version"] = FORMAT, FORMAT_VERSION
        for name in ATTRIBUTES:
            out.attrs[name] = "text"
        out.attrs["columns"], out.attrs["worlds"] = json.dumps(columns), 1
        out["index"] = np.array([[k, 0, max(k - 1, 0)] for k in range(6)], np.int32)
        out["frames/physics/qpos"] = np.zeros((6, 7))
        out["frames/goal"] = np.zeros((1, 2), bool)
        out["steps/action"] = np.zeros((5, 2), np.float32)
        run = out.create_group("run_000000")
        run.attrs["frames"], run.attrs["world"], run.attrs["row"] = 6, 0, 0
        run.attrs["parts"] = np.array([[0, 2], [2, 4]])

    def read(file: pathlib.Path) -> None:
        with Recording(file) as recording:
            recording.value("worlds", int)
            for run in recording.runs:
                for name in recording.columns:
                    run.all_rows(name)
                run.kept(0, min(run.frames, 6))

    return Reader(file_reader(folder / "read.h5", read), file.read_bytes(), hdf5_or_bytes)


def igibson_logs(folder: pathlib.Path) -> Reader:
    from ig2mj.demos.igibson import read_igibson

    file = folder / "log.hdf5"
    with h5py.File(file, "w") as out:
        out["frame_data"] = np.zeros((3, 4))
        for body in ("0", "1"):
            out[f"physics_data/{body}/position"] = np.zeros((3, 3))
            out[f"physics_data/{body}/orientation"] = np.ones((3, 4))
            out[f"physics_data/{body}/joint_state"] = np.zeros((3, 1))
        out["goal_status/satisfied"] = np.zeros((3, 2))
        out["agent_actions/vr_robot"] = np.zeros((3, 28))
        out.attrs["/metadata/obj_body_id_to_name"] = json.dumps({"0": "apple_0"})
        out.attrs["/metadata/physics_timestep"] = 1 / 120

    return Reader(file_reader(folder / "read.h5", read_igibson), file.read_bytes(), hdf5_or_bytes)


def checkpoints(folder: pathlib.Path) -> Reader:
    from ig2mj.learn.checkpoints import Checkpoints

    tree, depends = {"weights": np.arange(6.0, dtype=np.float32).reshape(2, 3), "step": np.int32(3)}, {"task": "reach"}
    kept = Checkpoints(folder)
    kept.save(1, tree, {"depends": depends, "iteration": 1})
    kept.save(2, tree, {"depends": depends, "iteration": 2})
    meta = kept.folder / "2" / "meta.json"

    def read(file: pathlib.Path) -> None:
        found = kept.newest(tree, depends)
        assert found is not None
        assert found[1]["depends"] == depends

    return Reader(file_reader(meta, read), meta.read_bytes(), json_or_bytes)


def devices(folder: pathlib.Path) -> Reader:
    from ig2mj.vr.messages import decode

    pose = [0.1, 1.0, 0.2, 0.0, 0.0, 0.0, 1.0]
    hand = {
        "pose": pose,
        "trigger": 0.5,
        "squeeze": 0.0,
        "stick": [0.0, 1.0],
        "buttons": 3,
    }
    valid = {"type": "devices", "time": 1.0, "head": pose, "hands": [hand, hand], "gaze": None}

    def read(raw: bytes) -> None:
        decode(raw.decode("utf-8", "surrogateescape"))

    return Reader(read, json.dumps(valid).encode(), json_or_bytes, (ValueError,))


def page_messages(folder: pathlib.Path) -> Reader:
    import msgspec

    from ig2mj.web.viser_server import check_message

    valid = {"type": "GuiUpdateMessage", "uuid": "a", "updates": {"value": [1.0, 2, "x"]}}

    def mutate(valid: dict, seed: int) -> bytes:
        if seed % 2:
            return mutated_bytes(msgspec.msgpack.encode(valid), seed)
        try:
            return msgspec.msgpack.encode(mutated_json(valid, seed))
        except (OverflowError, UnicodeEncodeError):
            return b"\xc1"

    packed = msgspec.msgpack.encode(valid)
    return Reader(lambda raw: check_message(raw, lambda uuid: (1.0, 2, "x")), valid, mutate, (ValueError,), packed)


def engine_profiles(folder: pathlib.Path) -> Reader:
    from tiny_home import write_tiny_home

    from ig2mj.engine.warp.profile import PROFILE_FILE, default_profile, load_profile, profile_of_scene, save_profile
    from ig2mj.scene.scene import load_scene

    scene = load_scene(write_tiny_home(folder / "home"))
    file = save_profile(default_profile(scene.model), folder)

    def read(file: pathlib.Path) -> None:
        found = load_profile(folder, scene.model)
        assert found.for_worlds(3).contacts >= 1
        profile_of_scene(scene)

    assert file.name == PROFILE_FILE
    return Reader(file_reader(file, read), file.read_bytes(), json_or_bytes)


def saved_worlds(folder: pathlib.Path) -> Reader:
    from tiny_home import write_tiny_home

    from ig2mj.simulation import Simulation

    world = Simulation(write_tiny_home(folder / "home"))
    world.save(folder / "saved.npz")
    valid = (folder / "saved.npz").read_bytes()

    return Reader(file_reader(folder / "read.npz", lambda file: world.load(file)), valid, npz_or_bytes)


def dumps(folder: pathlib.Path) -> Reader:
    """Mutations leave the compiled model alone: it is MuJoCo's to read."""
    import jax
    from tiny_home import write_tiny_home

    from ig2mj.engine.registry import make_engine
    from ig2mj.scene.scene import load_scene
    from ig2mj.states.initial import initial_states
    from ig2mj.states.model import StateModel
    from ig2mj.viewer.replay import Replay
    from ig2mj.worlds.recorder import MODEL, Frames, load_dump, save_dump

    scene = load_scene(write_tiny_home(folder / "home"))
    engine = make_engine("native", scene, 1)
    states = initial_states(StateModel.of_manifest(scene.tables, scene.manifest), 1)
    frames = Frames(engine.snapshot(engine.reset()), jax.tree.map(np.asarray, states))
    frames = jax.tree.map(lambda a: np.concatenate([a, a]), frames)
    file = folder / "dump.npz"
    save_dump(frames, file, scene.name, {"world": 0, "flags": 0}, scene.model)

    def mutate(valid: bytes, seed: int) -> bytes:
        return npz_or_bytes(valid, seed, kept=(f"{MODEL}.npy",))

    def read(file: pathlib.Path) -> None:
        load_dump(file, frames, scene.name)
        shown = Replay(scene, file)
        shown.step()

    return Reader(file_reader(folder / "read.npz", read), file.read_bytes(), mutate)


READERS: dict[str, Callable[[pathlib.Path], Reader]] = {
    f.__name__: f
    for f in (
        rooms, expressions, manifests, models, pools, robots, layouts, journals, activities, overrides, policies,
        demonstrations, recordings, igibson_logs, checkpoints, devices, page_messages, engine_profiles, saved_worlds,
        dumps,
    )
}  # fmt: skip
