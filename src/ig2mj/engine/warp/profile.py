"""`EngineProfile`: how large the Warp engine's buffers are. Written by `ig2mj calibrate`, read by the engine.

MJX-Warp allocates per world for the most degrees of freedom awake at once, the most constraint rows and the most
contacts. What does not fit is lost, and the world is flagged (`ig2mj.worlds.guards`). Sizes that hold everything would
take far more memory than homes ever use, so they are measured per scene and kept beside its manifest.
"""

from __future__ import annotations

import math
import os
import pathlib

import msgspec
import mujoco

from ig2mj.errors import InputError

PROFILE_FILE = "engine_profile.json"


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


def default_profile(model: mujoco.MjModel) -> EngineProfile:
    """Sizes that hold whatever a household scene does: everything awake, every geom in contact with several others."""
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


def load_profile(folder: str | os.PathLike, model: mujoco.MjModel) -> EngineProfile:
    """The profile beside a scene's manifest, or the safe default where there is none.

    Raises:
      InputError: the file is broken.
    """
    file = pathlib.Path(folder) / PROFILE_FILE
    if not file.exists():
        return default_profile(model)
    mend = "run `ig2mj calibrate` again, or delete the file"
    try:
        profile = msgspec.json.decode(file.read_bytes(), type=EngineProfile)
    except msgspec.MsgspecError as e:
        raise InputError(file, f"is no engine profile: {e}", mend=mend) from e
    for name in ("awake_dofs", "constraints", "contacts", "convex_contacts"):
        if getattr(profile, name) < 1:
            raise InputError(file, "must be at least 1", element=name, mend=mend)
    for name in ("spare_contacts", "spare_convex_contacts"):
        if getattr(profile, name) < 0:
            raise InputError(file, "must not be negative", element=name, mend=mend)
    return fit(profile, model)


def fit(profile: EngineProfile, model: mujoco.MjModel) -> EngineProfile:
    """The profile with no more awake degrees of freedom than the model has."""
    return msgspec.structs.replace(profile, awake_dofs=min(profile.awake_dofs, int(model.nv)))


def save_profile(profile: EngineProfile, folder: str | os.PathLike) -> pathlib.Path:
    """Writes the profile beside the manifest and says where."""
    file = pathlib.Path(folder) / PROFILE_FILE
    file.write_bytes(msgspec.json.format(msgspec.json.encode(profile), indent=1) + b"\n")
    return file
