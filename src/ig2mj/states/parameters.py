"""`StateParameters`: what the objects' abilities mean in numbers, as numpy arrays closed over by jitted functions.

Axes: O objects, S heat sources, C water sources, T cleaning tools, M halves of sliceable objects, D dustyable and
stainable objects (each its own axis of rows).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.knowledge import ABILITIES
from ig2mj.knowledge.overrides import shipped_overrides
from ig2mj.scene.manifest import Manifest
from ig2mj.scene.tables import LinkKind, SceneTables
from ig2mj.states.options import Compat

Abilities = Mapping[str, Mapping[str, float | bool]]


@dataclasses.dataclass(frozen=True, eq=False)
class HalfPose:
    """A half of a sliceable object, by object indices, with its base pose in the whole's base frame."""

    whole: int
    half: int
    pos: tuple[float, float, float]
    quat: tuple[float, float, float, float]


@dataclasses.dataclass(frozen=True, eq=False)
class StateParameters:
    """Constants of the extended states.

    Attributes:
      abilities: of each object, {ability: {parameter: value}} (the taxonomy's names).
      thermal: objects with a temperature: cookable, burnable or freezable (table A.2), and containers in a scene with
        substances.
      cook_temperature, burn_temperature: Celsius, inf where the object lacks the ability. freeze_temperature: -inf.
      wetness_soaked: droplets. dusty_threshold, stained_threshold: fraction of particles. slice_force: newtons.
        open_fraction: part of a joint's range. All inf where the object lacks the ability.
      heat_*: heat sources and sinks: object, annotated link (-1: none), Celsius, 1/s, metres, and conditions.
      water_object, water_link: water sources that have their link.
      tool_object, tool_link: cleaning tools; link -1 where there is none.
      dust_rows, stain_rows: the objects that carry rows of particles.
      half_object, half_whole, half_pos, half_quat: halves of sliceable objects and where they appear.
    """

    abilities: tuple[Abilities, ...]
    thermal: Bool[np.ndarray, "O"]
    cook_temperature: Float[np.ndarray, "O"]
    burn_temperature: Float[np.ndarray, "O"]
    freeze_temperature: Float[np.ndarray, "O"]
    wetness_soaked: Float[np.ndarray, "O"]
    dusty_threshold: Float[np.ndarray, "O"]
    stained_threshold: Float[np.ndarray, "O"]
    slice_force: Float[np.ndarray, "O"]
    open_fraction: Float[np.ndarray, "O"]
    heat_object: Int[np.ndarray, "S"]
    heat_link: Int[np.ndarray, "S"]
    heat_temperature: Float[np.ndarray, "S"]
    heat_rate: Float[np.ndarray, "S"]
    heat_distance: Float[np.ndarray, "S"]
    heat_requires_toggled_on: Bool[np.ndarray, "S"]
    heat_requires_closed: Bool[np.ndarray, "S"]
    heat_requires_inside: Bool[np.ndarray, "S"]
    water_object: Int[np.ndarray, "C"]
    water_link: Int[np.ndarray, "C"]
    tool_object: Int[np.ndarray, "T"]
    tool_link: Int[np.ndarray, "T"]
    dust_rows: Int[np.ndarray, "Dd"]
    stain_rows: Int[np.ndarray, "Ds"]
    half_object: Int[np.ndarray, "M"]
    half_whole: Int[np.ndarray, "M"]
    half_pos: Float[np.ndarray, "M 3"]
    half_quat: Float[np.ndarray, "M 4"]

    def has(self, ability: str) -> Bool[np.ndarray, "O"]:
        """Which objects have the ability."""
        return np.array([ability in a for a in self.abilities], bool)

    def column(self, ability: str, parameter: str, absent: float) -> Float[np.ndarray, "O"]:
        """A parameter of an ability for all objects; `absent` for those without the ability."""
        return np.array([a[ability][parameter] if ability in a else absent for a in self.abilities], np.float32)

    def halves_of(self, obj: int) -> tuple[int, ...]:
        """Objects that replace `obj` when it is sliced; empty for one that has no halves."""
        return tuple(int(h) for h in self.half_object[self.half_whole == obj])


def parameters_of_manifest(manifest: Manifest, tables: SceneTables, compat: Compat = "paper") -> StateParameters:
    """The parameters of a scene as its manifest states them."""
    index = {name: i for i, name in enumerate(tables.object_names)}
    parts = [HalfPose(index[o.name], index[p.object], p.pos, p.quat) for o in manifest.objects for p in o.parts]
    return make_parameters(tables, [o.abilities for o in manifest.objects], parts, compat)


def make_parameters(
    tables: SceneTables, abilities: Sequence[Abilities], parts: Sequence[HalfPose] = (), compat: Compat = "paper"
) -> StateParameters:
    """Turns abilities (one mapping per object) into arrays.

    A parameter that an ability leaves out has the default of `ig2mj.knowledge.ABILITIES`. With compat="igibson",
    iGibson's hard-coded exceptions (floors are dusty above 0.75) replace what the abilities say.
    """
    abilities = [_settled(a, category, compat) for a, category in zip(abilities, tables.object_categories, strict=True)]

    def column(ability: str, parameter: str, absent: float) -> Float[np.ndarray, "O"]:
        return np.array([a[ability][parameter] if ability in a else absent for a in abilities], np.float32)

    def owners(ability: str) -> Int[np.ndarray, "N"]:
        return np.array([i for i, a in enumerate(abilities) if ability in a], int)

    sources = [(i, a.get("heatSource", a.get("coldSource"))) for i, a in enumerate(abilities)]
    sources = [(i, p) for i, p in sources if p is not None]

    def heat(parameter: str, dtype: type) -> np.ndarray:
        return np.array([p[parameter] for _, p in sources], dtype)

    heat_object = np.array([i for i, _ in sources], int)
    water = owners("waterSource")
    water_link = links_of(tables, LinkKind.WATER_SOURCE)[water]
    tools = owners("cleaningTool")
    return StateParameters(
        abilities=tuple(abilities),
        thermal=np.array([bool({"cookable", "burnable", "freezable"} & set(a)) for a in abilities], bool),
        cook_temperature=column("cookable", "cook_temperature", np.inf),
        burn_temperature=column("burnable", "burn_temperature", np.inf),
        freeze_temperature=column("freezable", "freeze_temperature", -np.inf),
        wetness_soaked=column("soakable", "wetness_soaked", np.inf),
        dusty_threshold=column("dustyable", "dusty_threshold", np.inf),
        stained_threshold=column("stainable", "stained_threshold", np.inf),
        slice_force=column("sliceable", "slice_force", np.inf),
        open_fraction=column("openable", "open_fraction", np.inf),
        heat_object=heat_object,
        heat_link=links_of(tables, LinkKind.HEAT_SOURCE)[heat_object],
        heat_temperature=heat("temperature", np.float32),
        heat_rate=heat("heating_rate", np.float32),
        heat_distance=heat("distance_threshold", np.float32),
        heat_requires_toggled_on=heat("requires_toggled_on", bool),
        heat_requires_closed=heat("requires_closed", bool),
        heat_requires_inside=heat("requires_inside", bool),
        water_object=water[water_link >= 0],
        water_link=water_link[water_link >= 0],
        tool_object=tools,
        tool_link=links_of(tables, LinkKind.CLEANING_TOOL_AREA)[tools],
        dust_rows=owners("dustyable"),
        stain_rows=owners("stainable"),
        half_object=np.array([p.half for p in parts], int),
        half_whole=np.array([p.whole for p in parts], int),
        half_pos=np.array([p.pos for p in parts], np.float32).reshape(-1, 3),
        half_quat=np.array([p.quat for p in parts], np.float32).reshape(-1, 4),
    )


def links_of(tables: SceneTables, kind: LinkKind) -> Int[np.ndarray, "O"]:
    """Index of each object's annotated link of a kind, -1 where it has none."""
    found = np.full(tables.num_objects, -1)
    of_kind = np.flatnonzero(tables.link_kind == kind)
    found[tables.link_object[of_kind]] = of_kind
    return found


def _settled(abilities: Abilities, category: str, compat: Compat) -> dict[str, dict[str, float | bool]]:
    """Defaults filled in; the code's exceptions of this category laid over them."""
    found = {}
    exceptions = shipped_overrides().compat.get(compat, {}).get(category, {})
    for name, parameters in abilities.items():
        defaults = ABILITIES[name].defaults if name in ABILITIES else {}
        found[name] = {**defaults, **parameters, **(exceptions.get(name) or {})}
    if "coldSource" in found:
        found.pop("heatSource", None)
    return found
