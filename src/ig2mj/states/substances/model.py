"""`SubstanceModel`: what of a scene's substances does not change during a run.

Axes: U substances in use, C containers, D objects that can be covered, N = 20 points of each.
"""

from __future__ import annotations

import dataclasses
import functools
import zlib
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.errors import StateError
from ig2mj.geometry.surface import object_surfaces, sample_surface, uncovered
from ig2mj.knowledge.substances import DRY, DUST, STAIN, WATER, Substance, substance
from ig2mj.knowledge.transitions import Transition
from ig2mj.scene.manifest import InsideEntry
from ig2mj.scene.parking import rules_in_use
from ig2mj.scene.tables import SceneTables
from ig2mj.states.parameters import StateParameters
from ig2mj.states.substances.containers import Containers
from ig2mj.states.substances.things import Things

if TYPE_CHECKING:
    from ig2mj.states.model import StateModel

NUM_POINTS = 20
"""Points of an object that a substance can cover, as many as particles of dust (iGibson's particles.py)."""

TRIES = 30
"""Points drawn for each."""

STEEPEST = -0.7071
"""Smallest z of a point's normal in the frame of its body: as for dust, 135 degrees from the vertical."""

ALWAYS = (DUST, STAIN)
"""Substances that every scene has; they have states of their own."""


@dataclasses.dataclass(frozen=True, eq=False)
class SubstanceModel:
    """Constants.

    Attributes:
      substances: the U axis; dust and stain are never in it. water: position of water, -1: it is not in use.
      freeze: Celsius at which each is solid, -inf: never. has_volume: it can be in containers.
      cleaners: [U, U] whether a tool saturated with the second removes the first. dry: whether every tool does.
        wet: whether a tool soaked with water does.
      rules: transition rules of containers that have all they need among the substances and objects. containers: see
        `Containers`. things: objects that rules use up or make.
      covered: objects of the D axis. row: place of each object on it, or D. body, pos, normal: points, in the frames of
        bodies.
    """

    substances: tuple[Substance, ...]
    water: int
    freeze: Float[np.ndarray, "U"]
    has_volume: Bool[np.ndarray, "U"]
    cleaners: Bool[np.ndarray, "U U"]
    dry: Bool[np.ndarray, "U"]
    wet: Bool[np.ndarray, "U"]
    rules: tuple[Transition, ...]
    containers: Containers
    things: Things
    covered: Int[np.ndarray, "D"]
    row: Int[np.ndarray, "O"]
    body: Int[np.ndarray, "D N"]
    pos: Float[np.ndarray, "D N 3"]
    normal: Float[np.ndarray, "D N 3"]

    @classmethod
    def build(
        cls,
        tables: SceneTables,
        wanted: Sequence[str],
        insides: Mapping[int, InsideEntry],
        parameters: StateParameters,
    ) -> SubstanceModel:
        """That of a scene.

        Args:
          wanted: names of substances. insides: of the objects that are containers.

        Raises:
          UnknownNameError: a substance is not known.
        """
        used = tuple(substance(name) for name in dict.fromkeys(wanted) if name not in ALWAYS)
        names = [s.name for s in used]
        building = ("walls", "ceilings")
        covered = [o for o, category in enumerate(tables.object_categories) if category not in building]
        covered = [o for o in covered if np.any(tables.piece_object == o)]
        row = np.full(tables.num_objects, len(covered))
        row[covered] = np.arange(len(covered))
        points = _all_points(tables, tuple(covered))
        things, rules = Things.build(tables, rules_in_use(names, tables.object_categories), names, insides)
        return cls(
            substances=used,
            water=names.index(WATER) if WATER in names else -1,
            freeze=np.array([-np.inf if s.freeze is None else s.freeze for s in used], np.float32),
            has_volume=np.array([s.has_volume for s in used], bool),
            cleaners=np.array([[t.name in s.cleaned_by for t in used] for s in used], bool).reshape(
                len(used), len(used)
            ),
            dry=np.array([DRY in s.cleaned_by for s in used], bool),
            wet=np.array([WATER in s.cleaned_by for s in used], bool),
            rules=rules,
            things=things,
            containers=Containers.build(tables, insides, parameters.has("waterSink")),
            covered=np.array(covered, int),
            row=row,
            body=np.array([p[0] for p in points], int).reshape(-1, NUM_POINTS),
            pos=np.array([p[1] for p in points], np.float32).reshape(-1, NUM_POINTS, 3),
            normal=np.array([p[2] for p in points], np.float32).reshape(-1, NUM_POINTS, 3),
        )

    @property
    def names(self) -> tuple[str, ...]:
        """Of the substances."""
        return tuple(s.name for s in self.substances)


def of(model: StateModel) -> SubstanceModel:
    """The substances of a scene. Raises StateError: it has none."""
    if model.substances is None:
        raise StateError("the scene has no substances in use: load it with substances=['water'], or --substances water")
    return model.substances


@functools.lru_cache(maxsize=4)
def _all_points(tables: SceneTables, objects: tuple[int, ...]) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """`_points` of some objects of a scene; asked again, the same."""
    return [_points(tables, o) for o in objects]


def _points(tables: SceneTables, obj: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Bodies, places and normals of the points of one object, the same in every process."""
    rng = np.random.default_rng(zlib.crc32(f"{tables.object_categories[obj]} {obj}".encode()))
    surfaces = object_surfaces(tables, obj)
    areas = np.array([s.area for s in surfaces.values()])
    found: list[tuple[int, np.ndarray, np.ndarray]] = []
    for (body, surface), count in zip(
        surfaces.items(), rng.multinomial(TRIES * NUM_POINTS, areas / areas.sum()), strict=True
    ):
        k = np.flatnonzero((tables.piece_object == obj) & (tables.piece_body == body))
        sample = sample_surface(surface, int(count), rng)
        shape = (tables.piece_kind[k], tables.piece_size[k], tables.piece_planes[k])
        outside = uncovered(sample, *shape, tables.piece_pos[k], tables.piece_quat[k])
        least = -STEEPEST if tables.object_is_floor[obj] else STEEPEST
        found += [(body, p, n) for p, n in zip(outside.points, outside.normals, strict=True) if n[2] >= least]
    if not found:
        return np.full(NUM_POINTS, tables.object_root[obj]), np.zeros((NUM_POINTS, 3)), np.tile([0, 0, 1.0], (20, 1))
    chosen = [found[i] for i in rng.permutation(len(found))[:NUM_POINTS]]
    chosen += [chosen[0]] * (NUM_POINTS - len(chosen))
    return tuple(np.array(column) for column in zip(*chosen, strict=True))  # type: ignore[return-value]
