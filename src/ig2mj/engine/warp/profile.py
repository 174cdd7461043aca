"""`EngineProfile`: how large the Warp engine's buffers are. Written by `ig2mj calibrate`, read by the engine.

MJX-Warp allocates per world for the most degrees of freedom awake at once, the most constraint rows and the most
contacts. What does not fit is lost, and the world is flagged (`ig2mj.worlds.guards`). Sizes that hold everything would
take far more memory than homes ever use, so they are measured per scene and robot and kept next to its manifest:
`engine_profile.json` for the scene with the floating hand that calibration disturbs it with (which holds it bare, too),
`engine_profile.humanoid.json` and so on for robots. Where a robot has none, the scene's sizes are widened by the most
that the robot's own bodies could need. Objects that were added to the scene from the library are in no file: for them
the sizes grow by a rule of thumb.
"""

from __future__ import annotations

import math
import os
import pathlib
from collections.abc import Sequence

import msgspec
import mujoco
import numpy as np

from ig2mj.errors import InputError
from ig2mj.files.content import read_struct
from ig2mj.scene.scene import Scene

PROFILE_FILE = "engine_profile.json"

ADDED_CONTACTS = 8
"""Contacts of an object that was added from the library. One that lies on a table or in a basket has four to six."""

MOST = 10_000_000
"""Of anything in a profile: more than any engine can allocate."""

HAND = "floatinghand"
"""The robot whose sizes are the scene's."""


class EngineProfile(msgspec.Struct, omit_defaults=True):
    """Sizes of the Warp engine's buffers, per world.

    Attributes:
      awake_dofs: degrees of freedom awake at once (`nvmax`).
      constraints: constraint rows (`njmax`).
      contacts: contacts, on average over the worlds of a batch: the list is shared by all (`naconmax` / W).
      convex_contacts: contacts found by the general convex routine, likewise (`naccdmax` / W).
      spare_contacts, spare_convex_contacts: added once for the whole batch: what one world may have beyond the average.
        In a batch of one world it is what counts.
      measured: what the sizes come from: peaks, safety factor, versions. For people; not read back.
    """

    awake_dofs: int
    constraints: int
    contacts: int
    convex_contacts: int
    spare_contacts: int = 0
    spare_convex_contacts: int = 0
    measured: dict[str, float | int | str] = {}

    def for_worlds(self, num_worlds: int) -> EngineProfile:
        """The same buffers for a batch of this size, with the spare ones shared out among the worlds."""
        return msgspec.structs.replace(
            self,
            contacts=self.contacts + math.ceil(self.spare_contacts / num_worlds),
            convex_contacts=self.convex_contacts + math.ceil(self.spare_convex_contacts / num_worlds),
            spare_contacts=0,
            spare_convex_contacts=0,
        )


def holding(profile: EngineProfile, data: mujoco.MjData, num_worlds: int) -> EngineProfile:
    """Sizes no smaller than MJX needs to take over a state of one world, which it makes those of all worlds from.

    A home before it has come to rest is awake and has contacts within the margins of most of its objects, more than
    a few worlds together need later.

    Args:
      profile: for batches of `num_worlds` (`EngineProfile.for_worlds`). data: the state, after `mj_forward`.
    """
    contacts = max(profile.contacts, math.ceil(data.ncon / num_worlds))
    constraints = max(profile.constraints, int(data.nefc))
    convex = min(profile.convex_contacts, contacts)  # MJX refuses more of them than contacts
    return msgspec.structs.replace(profile, contacts=contacts, constraints=constraints, convex_contacts=convex)


def default_profile(model: mujoco.MjModel) -> EngineProfile:
    """Sizes that hold anything a household scene does: everything awake, every geom in contact with several others."""
    geoms = int(((model.geom_contype != 0) | (model.geom_conaffinity != 0)).sum())
    moving = int((model.body_treeid[model.geom_bodyid] >= 0).sum())
    contacts = max(64, 8 * min(moving, geoms))
    limits = int(model.jnt_limited.sum())
    friction = int((model.dof_frictionloss > 0).sum())
    return EngineProfile(
        awake_dofs=int(model.nv),
        constraints=4 * contacts + limits + friction + 6 * int(model.neq),
        contacts=contacts,
        convex_contacts=contacts,
    )


def holds_everything(profile: EngineProfile, model: mujoco.MjModel) -> bool:
    """Whether buffers of this size hold a scene with everything awake, as it is before it has come to rest."""
    widest = default_profile(model)
    names = ("awake_dofs", "constraints", "contacts", "convex_contacts")
    return all(getattr(profile, name) >= getattr(widest, name) for name in names)


def profile_file(agents: Sequence[object]) -> str:
    """Name of the file with the sizes for a scene with these agents: their classes' names in alphabetical order.
    Floating hands and functions that add bodies are not named."""
    kinds = sorted({type(agent).__name__.lower() for agent in agents if hasattr(agent, "attach")} - {HAND})
    stem, ending = PROFILE_FILE.split(".")
    return ".".join([stem, *kinds, ending])


def profile_of_scene(scene: Scene) -> EngineProfile:
    """The profile of a scene and its agents; without one for these agents, the scene's own, widened by what the agents
    could need; without any, the safe default. Objects that were added make it larger (`_with_additions`).

    Raises:
      InputError: the file is broken.
    """
    model, name = scene.model, profile_file(scene.agents)
    if not (scene.folder / name).exists() and not (scene.folder / PROFILE_FILE).exists():
        return default_profile(model)
    return fit(_with_additions(_measured_or_widened(scene, name), scene), model)


def _measured_or_widened(scene: Scene, name: str) -> EngineProfile:
    model = scene.model
    if name == PROFILE_FILE or (scene.folder / name).exists():
        return load_profile(scene.folder, model, name)
    profile, agents = load_profile(scene.folder, model), scene.tables.body_agent >= 0
    colliding = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    contacts = 8 * int((colliding & agents[model.geom_bodyid]).sum())
    rows = (model.jnt_limited[agents[model.jnt_bodyid]] != 0).sum() + 6 * _equalities(model, agents)
    rows += (model.dof_frictionloss[agents[model.dof_bodyid]] > 0).sum()
    return _wider(profile, int(agents[model.dof_bodyid].sum()), int(rows), contacts, contacts)


def _with_additions(profile: EngineProfile, scene: Scene) -> EngineProfile:
    """Sizes for a scene with objects of the library, of which its files know nothing.

    A task is about what was added, so all of it may be awake at once: all its degrees of freedom, its joints' limits
    and friction, and `ADDED_CONTACTS` for each object, a whole counting for the halves that it can be cut into.
    """
    if not scene.additions:
        return profile
    model, tables = scene.model, scene.tables
    first = tables.object_names.index(scene.additions[0].name)  # they come last on the O axis
    body = tables.body_object >= first
    joints = model.jnt_limited[body[model.jnt_bodyid]] != 0
    friction = model.dof_frictionloss[body[model.dof_bodyid]] > 0
    contacts = ADDED_CONTACTS * len(scene.additions)
    return _wider(profile, int(body[model.dof_bodyid].sum()), int(joints.sum() + friction.sum()), contacts, contacts)


def _wider(profile: EngineProfile, dofs: int, rows: int, contacts: int, convex_contacts: int) -> EngineProfile:
    """Sizes with room for more: degrees of freedom, constraint rows in addition to those of contacts, contacts."""
    return msgspec.structs.replace(
        profile,
        awake_dofs=profile.awake_dofs + dofs,
        constraints=profile.constraints + 4 * contacts + rows,
        contacts=profile.contacts + contacts,
        convex_contacts=profile.convex_contacts + convex_contacts,
    )


def _equalities(model: mujoco.MjModel, agents: np.ndarray) -> int:
    """The most constraints with agents' bodies that are active at once: those active from the start, and one grasp for
    each body that has any."""
    welds = np.isin(model.eq_type, (mujoco.mjtEq.mjEQ_WELD, mujoco.mjtEq.mjEQ_CONNECT))
    of_agent = welds & agents[np.where(welds, model.eq_obj1id, 0)]
    asleep = of_agent & (model.eq_active0 == 0)
    return int((model.eq_active0 != 0).sum()) + len(set(model.eq_obj1id[asleep]))


def load_profile(folder: str | os.PathLike, model: mujoco.MjModel, name: str = PROFILE_FILE) -> EngineProfile:
    """The profile next to a scene's manifest, or the safe default where there is none.

    Args:
      name: of the file.

    Raises:
      InputError: the file is broken.
    """
    file = pathlib.Path(folder) / name
    if not file.exists():
        return default_profile(model)
    fix = "run `ig2mj calibrate` again, or delete the file"
    profile = read_struct(file, EngineProfile, fix=fix)
    for name in ("awake_dofs", "constraints", "contacts", "convex_contacts"):
        if not 1 <= getattr(profile, name) <= MOST:
            raise InputError(file, f"must be between 1 and {MOST}", element=name, fix=fix)
    for name in ("spare_contacts", "spare_convex_contacts"):
        if not 0 <= getattr(profile, name) <= MOST:
            raise InputError(file, f"must be between 0 and {MOST}", element=name, fix=fix)
    return fit(profile, model)


def fit(profile: EngineProfile, model: mujoco.MjModel) -> EngineProfile:
    """The profile with no more awake degrees of freedom than the model has."""
    return msgspec.structs.replace(profile, awake_dofs=min(profile.awake_dofs, int(model.nv)))


def save_profile(profile: EngineProfile, folder: str | os.PathLike, name: str = PROFILE_FILE) -> pathlib.Path:
    """Writes the profile next to the manifest, under a name (`profile_file`), and says where."""
    file = pathlib.Path(folder) / name
    file.write_bytes(msgspec.json.format(msgspec.json.encode(profile), indent=1) + b"\n")
    return file
