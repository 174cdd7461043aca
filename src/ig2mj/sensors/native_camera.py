"""`NativeCamera`: what `BatchCamera` delivers, on the native engine: images by MuJoCo's renderer, rays by
`mj_multiRay`.

Colour and depth are one pass of OpenGL, segmentation is another. Shadows, reflections, multisampling and the sky are
off, as in the ray caster: with OpenGL in software shadows alone cost six times what everything else does.

Axes: W worlds, C cameras, Y rows, X columns, S slots, N rays of a pattern, O objects.
"""

from __future__ import annotations

import copy
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import jax
import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.base import Engine
from ig2mj.engine.view import Array, PhysicsView
from ig2mj.errors import EngineError
from ig2mj.geometry.frustum import spheres_in_view
from ig2mj.looks import visual_of
from ig2mj.looks.state_looks import OF_MATERIAL, lamp_geoms, tinted_materials
from ig2mj.scene.geom_groups import HIDDEN_GROUP, VISIBLE_GROUPS
from ig2mj.scene.scene import PLAIN
from ig2mj.sensors.gl_canvas import Canvas
from ig2mj.sensors.images import NOTHING, Images, Pose, RayPattern, camera_id, check_request
from ig2mj.sensors.particle_slots import fill_slots, slot_kinds
from ig2mj.sensors.render_model import drawn_lights, mean_colours
from ig2mj.sensors.slots import Slots
from ig2mj.sensors.tints import STATES, SWITCHED_ON, UNTINTED, tinted, tints, tints_of_geoms
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates
from ig2mj.worlds.draw import Draw


class NativeCamera:
    """Images and rays of worlds of the native engine; arguments and results as of `BatchCamera`, in NumPy."""

    def __init__(
        self,
        engine: Engine,
        model: StateModel,
        cameras: Sequence[str],
        *,
        width: int = 128,
        height: int = 128,
        rgb: bool = True,
        depth: bool = False,
        segmentation: bool = False,
        particles: int = 64,
        groups: Sequence[int] = VISIBLE_GROUPS,
        shadows: bool = False,
        rays: Sequence[RayPattern] = (),
        rows: tuple[int, int] | None = None,
        looks: str = PLAIN,
        varied: Collection[str] = (),
    ):
        """See `BatchCamera`. OpenGL is started by the first image; rays need none.

        Raises:
          EngineError: not the native engine, or nothing is to be made. UnknownNameError: no such camera.
        """
        if engine.renderer != "opengl":
            raise EngineError(f"the {engine.name} engine's worlds are not rendered by MuJoCo")
        check_request(cameras, rays, (rgb, depth, segmentation), width, height, rows)
        self._rows = slice(*rows) if rows is not None else slice(None)
        self.engine, self.model = engine, model
        self.width, self.height, self._particles = width, height, particles
        self._kinds = slot_kinds(model, particles)
        self.slots = len(self._kinds)
        self._wants, self._shadows, self._patterns = (rgb, depth, segmentation), shadows, tuple(rays)
        self._visual = visual_of(engine.scene, looks)
        self._drawn = copy.copy(self._visual.model)  # its colours change with the states
        self._colours = self._drawn.geom_rgba.copy(), self._drawn.mat_rgba.copy()
        self.cameras = {name: camera_id(self._drawn, name) for name in cameras}
        self._visible = np.isin(np.arange(mujoco.mjNGROUP), list(groups)).astype(np.uint8)
        if self._visible[HIDDEN_GROUP]:
            raise EngineError(f"geom group {HIDDEN_GROUP} is never seen (take the groups 0 to {HIDDEN_GROUP - 1})")
        self._owner = np.concatenate([self._visual.owner, np.full(self.slots, NOTHING)]).astype(np.int32)
        self._plain = mean_colours(self._drawn, np.arange(self._drawn.ngeom))
        self._material, self._group = self._drawn.geom_matid.copy(), self._drawn.geom_group.copy()
        self._fovy = self._drawn.cam_fovy.copy()
        self._in_tint, self._lamps = tinted_materials(self._drawn, STATES), lamp_geoms(self._drawn)
        self._canvas: Canvas | None = None
        self._look = engine.compile(self._look_fn)

    def __call__(
        self,
        physics: Any,
        view: PhysicsView,
        states: ExtendedStates,
        eyes: Mapping[str, Pose] | None = None,
        rendered: Bool[Array, "W"] | None = None,
        draw: Draw | None = None,
    ) -> Images:
        """Images of the present state of every world; see `BatchCamera`."""
        drawn = jax.tree.map(np.asarray, draw or Draw())
        eyes = {name: (np.asarray(pos), np.asarray(quat)) for name, (pos, quat) in (eyes or {}).items()}
        count, (rgb, depth, segmentation) = self.engine.num_worlds, self._wants
        shape = (count, len(self.cameras), self.height, self.width)
        colour = np.zeros((*shape, 3), np.uint8) if rgb and self.cameras else None
        far = np.zeros(shape, np.float32) if depth and self.cameras else None
        geom = np.full(shape, NOTHING, np.int32) if segmentation and self.cameras else None
        rays = {p.name: np.full((count, len(p.directions)), np.inf, np.float32) for p in self._patterns}
        slots = None
        if self.cameras:
            tint, slots = jax.tree.map(np.asarray, self._look(states, view))
        for w in range(count) if rendered is None else np.flatnonzero(np.asarray(rendered)).tolist():
            live, data = self.engine.to_mujoco(physics, w)
            data = self._visual.data(live, data)
            self._take_colours(live)
            self._take_materials(live)
            for pattern in self._patterns:
                pos, quat = eyes[pattern.name]
                rays[pattern.name][w] = self._cast(data, pattern, pos[w], quat[w])
            if slots is None:
                continue
            self._tint(tint[w])
            for c, (name, number) in enumerate(self.cameras.items()):
                pose = tuple(part[w] for part in eyes[name]) if name in eyes else None
                lights = None if drawn.light_colour is None else (drawn.light_colour[w], drawn.light_quat[w])
                if drawn.camera_slope is not None:
                    slope = np.tan(np.deg2rad(self._fovy[number]) / 2) * drawn.camera_slope[w]
                    self._drawn.cam_fovy[number] = np.rad2deg(2 * np.arctan(slope))
                one = self._draw(data, number, pose, slots, w, lights)
                self._drawn.cam_fovy[number] = self._fovy[number]
                for images, image in zip((colour, far, geom), one, strict=True):
                    if images is not None and image is not None:
                        images[w, c, self._rows] = image[self._rows]
        return Images(
            rgb=colour,
            depth=far,
            segmentation=None if geom is None or slots is None else self._objects(geom, slots),
            geom=geom,
            slots=slots,
            rays=rays,
        )

    def close(self) -> None:
        """Frees the OpenGL context; the next image makes a new one."""
        if self._canvas is not None:
            self._canvas.close()
            self._canvas = None

    def prepare_devices(self, devices: Sequence[Any]) -> None:
        """Nothing: OpenGL renders on its own device."""

    def _look_fn(self, states: ExtendedStates, view: PhysicsView) -> tuple[Any, Slots]:
        """Tints of objects, and particles."""
        return tints(self.model, states), fill_slots(self.model, states, view, self._particles)

    def _take_colours(self, live: mujoco.MjModel) -> None:
        """Gives geoms and materials the colours of a world's model; what the looks hide or add keeps theirs."""
        plain, drawn = self.engine.scene.model, self._drawn
        for colours, base, own, usual in (
            (drawn.geom_rgba, self._colours[0], live.geom_rgba, plain.geom_rgba),
            (drawn.mat_rgba, self._colours[1], live.mat_rgba, plain.mat_rgba),
        ):
            colours[:] = base
            if self._visual.looks == PLAIN:
                colours[:] = own
            else:
                changed = np.flatnonzero((own != usual).any(axis=1))
                colours[changed] = own[changed]
            colours[:, 3] = colours[:, 3] > 0  # glass is opaque, as to the ray caster; OpenGL gives it no depth

    def _take_materials(self, live: mujoco.MjModel) -> None:
        """Gives geoms the materials of a world's model where they differ from the scene's."""
        usual = self.engine.scene.model.geom_matid
        self._drawn.geom_matid[:] = self._material
        changed = np.flatnonzero(live.geom_matid != usual)
        self._drawn.geom_matid[changed] = live.geom_matid[changed]

    def _tint(self, tint: Int[np.ndarray, "O"]) -> None:
        """Gives geoms of objects whose state shows the materials of their tints, or their mean colours, tinted."""
        for light, _ in self._lamps:
            self._drawn.light_active[light] = False
        if (tint == UNTINTED).all():
            return
        of_geoms = np.asarray(tints_of_geoms(tint[None], self._visual.owner))[0]
        geoms = np.flatnonzero(of_geoms != UNTINTED)
        self._drawn.geom_rgba[geoms, :3] = np.asarray(tinted(self._plain[geoms, :3], of_geoms[None, geoms]))[0]
        self._drawn.geom_rgba[geoms, 3] = self._plain[geoms, 3] > 0
        material = self._in_tint[of_geoms[geoms], geoms]
        self._drawn.geom_matid[geoms] = material
        self._drawn.geom_rgba[geoms[material >= 0]] = OF_MATERIAL
        for light, geom in self._lamps:
            self._drawn.light_active[light] = of_geoms[geom] == SWITCHED_ON

    def _draw(
        self,
        data: mujoco.MjData,
        camera: int,
        pose: tuple[np.ndarray, ...] | None,
        slots: Slots,
        world: int,
        lights: tuple[np.ndarray, np.ndarray] | None = None,
    ) -> tuple[np.ndarray | None, np.ndarray | None, np.ndarray | None]:
        if self._canvas is None:
            of_lights = drawn_lights(self._drawn, self.engine.scene.model)
            size = self.width, self.height
            self._canvas = Canvas(self._drawn, *size, self._visible, self._kinds, of_lights, self._shadows)
        keep = data.cam_xpos[camera].copy(), data.cam_xmat[camera].copy()
        try:
            if pose is not None:
                data.cam_xpos[camera], data.cam_xmat[camera] = pose[0], _matrix(pose[1]).ravel()
            self._drawn.geom_group[:] = np.where(self._in_view(data, camera), self._group, HIDDEN_GROUP)
            self._canvas.update(data, camera, slots, world, lights)
        finally:
            data.cam_xpos[camera], data.cam_xmat[camera] = keep
            self._drawn.geom_group[:] = self._group
        return self._canvas.draw(*self._wants)

    def _in_view(self, data: mujoco.MjData, camera: int) -> Bool[np.ndarray, "G"]:
        """Geoms that may be in view: others are not drawn, which saves most of an image's time where OpenGL runs in
        software."""
        if self._shadows:
            return np.ones(self._drawn.ngeom, bool)
        up = np.tan(np.deg2rad(float(self._drawn.cam_fovy[camera])) / 2)
        right = up * self.width / self.height
        local = (data.geom_xpos - data.cam_xpos[camera]) @ data.cam_xmat[camera].reshape(3, 3)
        return spheres_in_view(local, self._drawn.geom_rbound, -right, right, -up, up)

    def _cast(
        self, data: mujoco.MjData, pattern: RayPattern, pos: Float[np.ndarray, "3"], quat: Float[np.ndarray, "4"]
    ) -> Float[np.ndarray, "N"]:
        """Distances along the rays of a pattern from the pose of its point, m; infinite where nothing is hit."""
        count, origin = len(pattern.directions), pos.astype(np.float64)
        directions = pattern.directions @ _matrix(quat).T
        found, distance = np.zeros(count, np.int32), np.zeros(count)
        reach = np.linalg.norm(data.geom_xpos - origin, axis=1) + self._drawn.geom_rbound
        hidden = (reach <= pattern.near) & (self._drawn.geom_rbound > 0)  # wholly too near, such as the robot's head
        self._drawn.geom_group[:] = np.where(hidden, HIDDEN_GROUP, self._group)
        mujoco.mj_multiRay(
            self._drawn,
            data,
            origin,
            directions.ravel(),
            self._visible,
            1,
            -1,
            found,
            distance,
            None,
            count,
            pattern.far + 1.0,  # nearest distances of boxes are compared with it, not those of surfaces
        )
        for ray in np.flatnonzero((distance >= 0) & (distance < pattern.near)):  # rays begin at the nearest range
            start = origin + pattern.near * directions[ray]
            beyond = mujoco.mj_ray(self._drawn, data, start, directions[ray], self._visible, 1, -1, found[:1])
            distance[ray] = -1.0 if beyond < 0 else pattern.near + beyond
        self._drawn.geom_group[:] = self._group
        return np.where((distance >= 0) & (distance <= pattern.far), distance, np.inf).astype(np.float32)

    def _objects(self, geom: Int[np.ndarray, "W C Y X"], slots: Slots) -> Int[np.ndarray, "W C Y X"]:
        """Objects of the geoms that are seen."""
        owner = np.tile(self._owner, (len(geom), 1))
        owner[:, len(self._owner) - self.slots :] = slots.owner
        world = np.arange(len(geom))[:, None, None, None]
        return np.where(geom >= 0, owner[world, np.maximum(geom, 0)], NOTHING).astype(np.int32)


def _matrix(quat: Float[np.ndarray, "4"]) -> Float[np.ndarray, "3 3"]:
    """MuJoCo's: for one rotation much faster than anything that is made for many."""
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, quat.astype(np.float64))
    return matrix.reshape(3, 3)
