"""`BatchCamera`: RGB, depth and segmentation of every world's cameras, by MJX-Warp's ray caster.

    camera = BatchCamera(engine, model, ["hand/eye"], width=128, height=128)
    step = jax.jit(lambda batch: camera(batch.world.physics, batch.world.view, batch.world.states))

It needs no OpenGL, and runs on a CPU too. Objects are tinted by their states (`ig2mj.sensors.tints`), and dust, stains
and water drops are drawn (`ig2mj.sensors.particle_slots`), in each world its own.

Axes: W worlds, C cameras, Y rows, X columns, G geoms of the scene, S slots.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from flax import struct
from jaxtyping import Float, Int, UInt8
from mujoco import mjx

from ig2mj.engine.base import Engine
from ig2mj.engine.mjx.engine import MjxEngine, MjxPhysics
from ig2mj.engine.view import Array, PhysicsView
from ig2mj.errors import EngineError, UnknownNameError
from ig2mj.geometry.poses import compose, quat_rotate, quat_to_matrix
from ig2mj.sensors.particle_slots import Slots, fill_slots
from ig2mj.sensors.render_model import BACKGROUND, make_render_model, mean_colours
from ig2mj.sensors.tints import UNTINTED, tinted, tints, tints_of_geoms
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates

NOTHING = -1
"""In a segmentation: no object there (sky, agents, the world's own geoms)."""


TILE = 8
"""Pixels a side of what a block of 64 threads sees: a third faster than rows of 64 pixels."""


@struct.dataclass
class Images:
    """Pictures of all worlds; what was not asked for is None.

    Attributes:
      rgb: 0..255, row 0 on top. depth: metres along the optical axis, 0 where nothing is hit.
      segmentation: index of the object seen, `NOTHING` where there is none; a particle counts as its object.
    """

    rgb: UInt8[Array, "W C Y X 3"] | None
    depth: Float[Array, "W C Y X"] | None
    segmentation: Int[Array, "W C Y X"] | None


class BatchCamera:
    """A pure function from worlds to pictures, for the Warp engine. Cameras ride on their bodies ("fixed" mode), at the
    poses of each world's `ModelFields`, but for those whose poses are given with each call."""

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
        groups: Sequence[int] = (0, 1, 2),
        shadows: bool = False,
        cull_backfaces: bool = False,
        devices: Sequence[str] | None = None,
    ):
        """Compiles the render model.

        Args:
          engine: whose worlds are seen. model: constants of the states.
          cameras: names.
          width, height: pixels, of every camera.
          rgb, depth, segmentation: what to make.
          particles: S, the most particles drawn in a world.
          groups: geom groups that are seen.
          shadows: cast them; about twice the time.
          cull_backfaces: surfaces seen from behind are not there, so that a camera inside a geom sees through it; a
            third more time.
          devices: Warp's names ("cuda:0", ...) where worlds are shared out over several devices; None: the default one.

        Raises:
          EngineError: not the Warp engine, or nothing is to be made. UnknownNameError: no such camera.
        """
        if not isinstance(engine, MjxEngine) or engine.name != "warp":
            raise EngineError(f"the {engine.name} engine has no batched cameras (take the warp engine)")
        if not (rgb or depth or segmentation) or not cameras or min(width, height) < 1:
            raise EngineError("a camera must have pixels and make at least one of rgb, depth and segmentation")
        self.engine, self.model = engine, model
        self.width, self.height, self.slots = width, height, particles
        self._wants = (rgb, depth, segmentation)
        self._host = host = make_render_model(engine.scene, particles)
        self.cameras = [_camera_id(host, name) for name in cameras]
        self._plan(host)
        self._model = mjx.put_model(host, impl="warp")
        data = mujoco.MjData(host)
        mujoco.mj_forward(host, data)
        self._template = mjx.put_data(host, data, impl="warp", naconmax=1, naccdmax=1, njmax=1)
        self._context = mjx.create_render_context(
            host,
            nworld=engine.num_worlds,
            devices=list(devices) if devices else None,
            cam_res=(width, height),
            render_rgb=rgb,
            render_depth=depth,
            render_seg=segmentation,
            enabled_geom_groups=list(groups),
            cam_active=self.cameras,
            background_color=BACKGROUND,
            use_shadows=shadows,
            enable_backface_culling=cull_backfaces,
        )
        self._handle = self._context.pytree()
        self._check_addresses()
        self._tiled = self._order_rays()

    def __call__(
        self,
        physics: MjxPhysics,
        view: PhysicsView,
        states: ExtendedStates,
        eyes: Mapping[str, tuple[Float[Array, "W 3"], Float[Array, "W 4"]]] | None = None,
    ) -> Images:
        """Pictures of the present state of every world. Pure: to be jitted, alone or with a step.

        Args:
          eyes: poses in the world (m, w-x-y-z) of cameras that do not ride on their bodies, by name: what
            `Controller.eye` of an agent gives that moves its eye without joints.

        Raises:
          UnknownNameError: there is no such camera.
        """
        slots = fill_slots(self.model, states, view, self.slots)
        moved = self._moved(physics, slots, eyes or {})
        look = self._look(states, slots)

        def cast(data: Any, look: dict[str, Array]) -> tuple[Array, Array, Array]:
            model = self._model.replace(**look)
            data = mjx.refit_bvh(model, data, self._handle)
            if self._wants[2]:
                return mjx.render_with_segmentation(model, data, self._handle)[:3]
            packed, depth, _ = mjx.render(model, data, self._handle)
            return packed, depth, jnp.zeros((0, 2), jnp.int32)

        packed, depth, seen = jax.vmap(cast)(moved, look)
        return Images(
            rgb=_unpack(self._rows(packed)) if self._wants[0] else None,
            depth=self._rows(depth) if self._wants[1] else None,
            segmentation=self._rows(self._objects(seen[..., 0], slots)) if self._wants[2] else None,
        )

    def _order_rays(self) -> bool:
        """Lets each block of threads cast the rays of a tile, which meet the same geoms; says whether it can."""
        contexts, pixels = list(self._context._contexts.values()), self.height * self.width
        if self.height % TILE or self.width % TILE or any(len(c.ray) != pixels * len(self.cameras) for c in contexts):
            return False
        tiles = np.arange(pixels).reshape(self.height // TILE, TILE, self.width // TILE, TILE).swapaxes(1, 2).ravel()
        order = (np.arange(len(self.cameras))[:, None] * pixels + tiles).ravel()
        for context in contexts:
            for rays in (context.ray, context.ray_offset):
                if len(rays) == len(order):
                    rays.assign(rays.numpy()[order])
        return True

    def _rows(self, pixels: Array) -> Array:
        """Pictures [W, C, Y, X] of what the rays saw, in the order in which they are cast."""
        shape = (self.engine.num_worlds, len(self.cameras))
        if not self._tiled:
            return pixels.reshape(*shape, self.height, self.width)
        tiles = pixels.reshape(*shape, self.height // TILE, self.width // TILE, TILE, TILE)
        return tiles.swapaxes(3, 4).reshape(*shape, self.height, self.width)

    def _check_addresses(self) -> None:
        """Pictures lie one after the other in the ray caster's buffers."""
        context, wanted = self._context, np.arange(len(self.cameras)) * self.width * self.height
        addresses = (context.rgb_adr, context.depth_adr, context.seg_adr)
        for address, made in zip(addresses, self._wants, strict=True):
            assert not made or (address.numpy() == wanted).all()

    def _plan(self, host: mujoco.MjModel) -> None:
        """Constants of the model, on the host."""
        slots = self.slots
        self._owner = np.concatenate([self.model.tables.geom_object, np.full(slots, -1)])
        self._plain = mean_colours(host, np.arange(host.ngeom))
        self._material = np.array(host.geom_matid, np.int32)
        self._size = np.array(host.geom_size, np.float32)
        self._camera_in_body = (host.cam_bodyid, _f32(host.cam_pos), _f32(host.cam_quat))
        self._light_in_body = (host.light_bodyid, _f32(host.light_pos), _f32(host.light_dir))

    def _moved(self, physics: MjxPhysics, slots: Slots, eyes: Mapping[str, tuple[Array, Array]]) -> Any:
        """Render data [W] with everything where physics has it."""
        data, worlds = physics.data, self.engine.num_worlds
        body, pos, quat = self._camera_in_body
        own = physics.fields
        pos = jnp.asarray(pos if own.cam_pos is None else own.cam_pos)
        quat = jnp.asarray(quat if own.cam_quat is None else own.cam_quat)
        camera_pos, camera_quat = compose(data.xpos[:, body], data.xquat[:, body], pos, quat)
        for name, (eye_pos, eye_quat) in eyes.items():
            camera = _camera_id(self._host, name)
            camera_pos, camera_quat = camera_pos.at[:, camera].set(eye_pos), camera_quat.at[:, camera].set(eye_quat)
        body, pos, direction = self._light_in_body
        light_quat = data.xquat[:, body]
        light_pos = data.xpos[:, body] + quat_rotate(light_quat, jnp.asarray(pos))
        light_dir = quat_rotate(light_quat, jnp.asarray(direction))
        spread = jax.vmap(lambda time: self._template.replace(time=time))(jnp.zeros(worlds, jnp.float32))
        return spread.tree_replace(
            {
                "geom_xpos": jnp.concatenate([data.geom_xpos, slots.pos], axis=1),
                "geom_xmat": jnp.concatenate([data.geom_xmat, slots.rotation], axis=1),
                "cam_xpos": camera_pos,
                "cam_xmat": quat_to_matrix(camera_quat),
                "_impl.light_xpos": light_pos,
                "_impl.light_xdir": light_dir,
            }
        )

    def _look(self, states: ExtendedStates, slots: Slots) -> dict[str, Array]:
        """Fields of the model that differ per world: colour and material of tinted geoms, size and colour of slots."""
        worlds, geoms = self.engine.num_worlds, len(self._plain) - self.slots
        tint = tints_of_geoms(tints(self.model, states), self._owner)
        plain = jnp.asarray(self._plain)
        colour = jnp.concatenate([tinted(plain[:, :3], tint)[:, :geoms], slots.colour], axis=1)
        alpha = jnp.broadcast_to(plain[:, 3:], (worlds, len(self._plain), 1))
        size = jnp.broadcast_to(jnp.asarray(self._size[:geoms]), (worlds, geoms, 3))
        return {
            "geom_rgba": jnp.concatenate([colour, alpha], axis=-1),
            "geom_matid": jnp.where(tint == UNTINTED, jnp.asarray(self._material), -1),
            "geom_size": jnp.concatenate([size, slots.size], axis=1),
        }

    def _objects(self, geom: Int[Array, "W N"], slots: Slots) -> Int[Array, "W N"]:
        """Objects of the geoms that are seen."""
        geoms = len(self._plain) - self.slots
        owner = jnp.asarray(self._owner, jnp.int32)[jnp.clip(geom, 0, geoms - 1)]
        if self.slots:
            particle = jnp.take_along_axis(slots.owner, jnp.clip(geom - geoms, 0, self.slots - 1), axis=1)
            owner = jnp.where(geom >= geoms, particle, owner)
        return jnp.where(geom >= 0, owner, NOTHING)


def _camera_id(model: mujoco.MjModel, name: str) -> int:
    number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_CAMERA, name)
    if number < 0:
        raise UnknownNameError("camera", name, [model.camera(c).name for c in range(model.ncam)])
    return number


def _unpack(packed: Array) -> Array:
    """Colour channels of the ray caster's packed pixels: red in bits 16-23, green in 8-15, blue in 0-7."""
    return jnp.stack([(packed >> shift) & 0xFF for shift in (16, 8, 0)], axis=-1).astype(jnp.uint8)


def _f32(array: np.ndarray) -> np.ndarray:
    return np.array(array, np.float32)
