"""`BatchCamera`: RGB, depth, segmentation and rays of every world, by MJX-Warp's ray caster.

    camera = BatchCamera(engine, model, ["hand/eye"], width=128, height=128)
    step = jax.jit(lambda batch: camera(batch.world.physics, batch.world.view, batch.world.states))

It needs no OpenGL, and runs on a CPU too. Objects are tinted by their states (`ig2mj.sensors.tints`), and dust, stains,
water drops and substances are drawn (`ig2mj.sensors.particle_slots`), in each world its own.

Axes: W worlds, C cameras, Y rows, X columns, G geoms of the scene, S slots.
"""

from __future__ import annotations

import weakref
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import warp as wp
from jaxtyping import Bool, Float, Int
from mujoco import mjx

from ig2mj.engine.base import Engine
from ig2mj.engine.mjx.physics import MjxPhysics, own_device
from ig2mj.engine.view import Array, PhysicsView
from ig2mj.engine.warp.kernels import models_put
from ig2mj.engine.warp.patches import graphs_kept, pins
from ig2mj.engine.warp.unwritten import unwritten_is_zero
from ig2mj.errors import EngineError
from ig2mj.geometry.poses import compose, quat_rotate, quat_to_matrix
from ig2mj.looks.costume import Followers
from ig2mj.looks.home_plan import covered_triangles
from ig2mj.looks.state_looks import OF_MATERIAL, lamp_geoms, tinted_materials
from ig2mj.looks.visual import visual_owners
from ig2mj.process.gc_pause import GC_PAUSED
from ig2mj.scene.geom_groups import VISIBLE_GROUPS
from ig2mj.scene.scene import PLAIN
from ig2mj.sensors.images import NOTHING, Images, Pose, RayPattern, camera_id, check_request
from ig2mj.sensors.merged_meshes import HIDDEN, Tables, alpha, mergeable, rigid_parts, robot_geoms, tables_of
from ig2mj.sensors.particle_slots import fill_slots, slot_kinds
from ig2mj.sensors.ray_cameras import sectors_of, set_rays, set_rows
from ig2mj.sensors.render_kernels import launches_of_images
from ig2mj.sensors.render_model import BACKGROUND, CAMERA_LIGHT, drawn_lights, make_render_model, mean_colours
from ig2mj.sensors.slots import Slots
from ig2mj.sensors.texture_filter import fit_textures
from ig2mj.sensors.tints import STATES, SWITCHED_ON, UNTINTED, tinted, tints, tints_of_geoms
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates
from ig2mj.worlds.draw import Draw

TILE = 8
"""Pixels a side of what a block of 64 threads sees: a third faster than rows of 64 pixels."""

ABOVE, UPWARDS = (0.0, 0.0, 1e5), (0.0, 1.0, 0.0, 0.0)
"""m and w-x-y-z: from where, and how turned, a camera sees nothing at all, so that its rays end before they begin."""

_KEPT: weakref.WeakKeyDictionary[Engine, list[Any]] = weakref.WeakKeyDictionary()
"""What the ray caster keeps, for as long as the engine whose worlds it sees: a compiled program that outlives its
`BatchCamera` goes on using it, and holds no reference to it."""


class BatchCamera:
    """A pure function from worlds to images, for the Warp engine. Cameras ride on their bodies ("fixed" mode), at the
    poses of each world's `ModelFields`, but for those whose poses are given with each call."""

    @GC_PAUSED
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
        cull_backfaces: bool = False,
        rays: Sequence[RayPattern] = (),
        merge_meshes: bool = True,
        rows: tuple[int, int] | None = None,
        looks: str = PLAIN,
        varied: Collection[str] = (),
    ):
        """Compiles the render model.

        Args:
          engine: whose worlds are seen. model: constants of the states.
          cameras: names.
          width, height: pixels, of every camera.
          rgb, depth, segmentation: what to make.
          particles: the most particles drawn in a world; with 0 no substances are drawn either.
          groups: geom groups that are seen.
          shadows: cast them; about twice the time.
          cull_backfaces: surfaces seen from behind are not there, so that a camera inside a geom sees through it; a
            third more time.
          rays: patterns to cast besides; each call gives the pose of each.
          merge_meshes: cast rays against one mesh for all that never moves and one for each rigid part that does
            (`ig2mj.sensors.merged_meshes`; a quarter less time); what is invisible in the compiled scene then is in
            every world. Scenes with flexes or height fields are not merged.
          rows: of each image the first that is made and the first below those; the others are as if nothing were
            there, and cost nothing. None: all.
          looks: how the home is seen: one of `ig2mj.scene.scene.LOOKS`.
          varied: what of `Draw` differs between worlds, of "lights" and "camera"; each call then takes it.

        Raises:
          EngineError: not the Warp engine, or nothing is to be made. UnknownNameError: no such camera.
        """
        if engine.renderer != "ray caster":
            raise EngineError(f"the {engine.name} engine has no batched cameras (take the warp engine)")
        check_request(cameras, rays, (rgb, depth, segmentation), width, height, rows)
        self.engine, self.model = engine, model
        self.width, self.height, self._particles = width, height, particles
        kinds = slot_kinds(model, particles)
        self.slots = len(kinds)
        self._wants, self._shown = (rgb, depth, segmentation), rows or (0, height)
        # lines of rays; where kernels are not those that we know all are cast
        self._lines = height if pins.obstacles() else self._shown[1] - self._shown[0]
        self._sectors = sectors_of(rays)
        self._patterns = {pattern.name: len(pattern.directions) for pattern in rays}
        self._lit, self._zooms = "lights" in varied, "camera" in varied
        if (self._lit or self._zooms) and (obstacle := pins.obstacles()):
            raise EngineError(f"lights and fields of view are the same in all worlds here: {obstacle}")
        sectors = [s.camera for s in self._sectors]
        self._host = host = make_render_model(engine.scene, kinds, sectors, looks, self._lit)
        self.cameras = [camera_id(host, name) for name in cameras]
        if rgb and cameras:
            fit_textures(host, float(2 * np.tan(np.deg2rad(host.cam_fovy[self.cameras].min()) / 2) / height))
        self._covered = {} if looks == PLAIN else covered_triangles(engine.scene)
        self._plan(host)
        with models_put() as put:
            self._model = mjx.put_model(host, own_device(), impl="warp")
        self._draw_of_light = drawn_lights(host, engine.scene.model)
        self._camera_light = host.light(CAMERA_LIGHT).id if self._lit else -1
        if self._lit:  # it only carries a colour
            self._model = self._model.replace(light_active=self._model.light_active.at[self._camera_light].set(False))
        if self._zooms:
            self._model = self._model.replace(cam_fovy=jnp.ones_like(self._model.cam_fovy))
        self._merged = self._merge(groups) if merge_meshes and mergeable(host) and not pins.obstacles() else None
        data = mujoco.MjData(host)
        mujoco.mj_forward(host, data)
        with unwritten_is_zero():
            self._template = mjx.put_data(host, data, own_device(), impl="warp", naconmax=1, naccdmax=1, njmax=1)
        self._settings: dict[str, Any] = dict(
            nworld=engine.num_worlds,
            cam_res=[(width, self._lines)] * len(cameras) + [(len(s.rays), 1) for s in self._sectors],
            render_rgb=self._for_each(rgb, False),
            render_depth=self._for_each(depth, True),
            render_seg=self._for_each(segmentation, False),
            enabled_geom_groups=list(groups),
            cam_active=[*self.cameras, *(camera_id(host, s.camera) for s in self._sectors)],
            background_color=BACKGROUND,
            use_shadows=shadows,
            enable_backface_culling=cull_backfaces,
            enable_specular=bool(max(host.light_specular.max(initial=0.0), *host.vis.headlight.specular) > 0.0),
            enable_emission=bool(host.mat_emission.max(initial=0.0) > 0.0),
            enable_per_light_ambient=bool(host.light_ambient.max(initial=0.0) > 0.0),
        )
        self._served = [str(wp.get_device())]
        self._make_context()
        engine.load_also(launches_of_images(put[0], self._context._default))  # pyright: ignore[reportAttributeAccessIssue]

    def prepare_devices(self, devices: Sequence[Any]) -> None:
        """Allocates memory on other devices of this process, before programs for them are compiled.

        The ray caster keeps its tree and its images in memory of its own on each device. Without this, only programs on
        the first device find them.
        """
        names = list(dict.fromkeys(str(wp.device_from_jax(device)) for device in devices))
        if names != self._served:
            self._served = names
            self._make_context()

    def _make_context(self) -> None:
        """What the ray caster keeps, on each device. What compiled programs know of stays as long as the engine."""
        self._context = mjx.create_render_context(self._host, devices=self._served, **self._settings)
        _KEPT.setdefault(self.engine, []).append(self._context)
        if self._lines < self.height:
            set_rows(self._context, self._host, self.cameras, (self.width, self.height), self._shown)
        if self._sectors:  # before the kernel is built: whether rays are displaced is compiled into it
            set_rays(self._context, self._sectors, self._pixels)
        contexts = list(self._context._contexts.values())
        if self._merged is not None:
            from ig2mj.sensors.ray_caster import use_merged

            robots = robot_geoms(self._host, self.engine.scene.tables.body_agent)
            use_merged(
                contexts, self._host, self._merged, self.engine.num_worlds, robots, len(self.cameras), self._changes
            )
        elif not pins.obstacles():
            from ig2mj.sensors.shading import limit_light

            for context in contexts:
                limit_light(context, self._host.nlight, changes=self._changes)
        self._handle = self._context.pytree()
        self._check_addresses()
        self._tiled = self._order_rays()

    @property
    def _changes(self) -> list[tuple[str, str]]:
        """Of the kernel, for what differs between worlds."""
        from ig2mj.sensors.shading import FOV_PER_WORLD, lights_per_world

        return [*(lights_per_world(self._camera_light) if self._lit else ()), *(FOV_PER_WORLD if self._zooms else ())]

    def _merge(self, groups: Sequence[int]) -> Tables | None:
        """Hides the geoms that merged meshes show, and invisible ones, from the ray caster's boxes; None where
        the scene shows no meshes."""
        host = self._host
        parts = rigid_parts(host, self.engine.scene.model, groups, self._covered)
        if not parts:
            return None
        tables = tables_of(host, parts, self.engine.scene.rooms)
        host.geom_group[tables.absorbed] = HIDDEN
        host.geom_group[alpha(host) == 0] = HIDDEN
        if len(tables.absorbed) and not np.isin(host.geom_group, list(groups)).any():
            host.geom_group[tables.absorbed[0]] = groups[0]  # the tree of boxes must not be empty
        self._model = self._model.replace(geom_dataid=tables.data_id)
        return tables

    def __call__(
        self,
        physics: MjxPhysics,
        view: PhysicsView,
        states: ExtendedStates,
        eyes: Mapping[str, Pose] | None = None,
        rendered: Bool[Array, "W"] | None = None,
        draw: Draw | None = None,
    ) -> Images:
        """Images of the present state of every world. Pure: to be jitted, alone or with a step.

        Args:
          eyes: poses in the world of cameras that do not ride on their bodies, by name: what `Controller.eye` of an
            agent gives that moves its eye without joints. Poses of all ray patterns, by their names.
          rendered: the worlds that matter; None: all. See `images.Camera`.
          draw: lights and fields of view of the worlds, where they differ.

        Raises:
          UnknownNameError: there is no such camera.
        """
        slots = fill_slots(self.model, states, view, self._particles)
        draw = draw or Draw()
        moved = self._moved(physics, slots, eyes or {}, rendered, draw)
        look = self._look(physics, states, slots) | self._of_draw(draw)

        def cast(data: Any, look: dict[str, Array]) -> tuple[Array, Array, Array]:
            model = self._model.replace(**look)
            data = mjx.refit_bvh(model, data, self._handle)
            if self._wants[2]:
                return mjx.render_with_segmentation(model, data, self._handle)[:3]
            packed, depth, _ = mjx.render(model, data, self._handle)
            return packed, depth, jnp.zeros((0, 2), jnp.int32)

        with graphs_kept():
            packed, depth, seen = jax.vmap(cast)(moved, look)
        pixels = self._pixels if self._wants[1] else 0
        geom = seen[..., 0]
        return Images(
            rgb=_unpack(self._rows(packed)) if self._wants[0] else None,
            depth=self._rows(depth[:, :pixels]) if self._wants[1] else None,
            segmentation=self._rows(self._objects(geom, slots), NOTHING) if self._wants[2] else None,
            geom=self._rows(geom, NOTHING) if self._wants[2] else None,
            slots=slots,
            rays=self._distances(depth[:, pixels:]),
        )

    @property
    def _pixels(self) -> int:
        """Of all images of a world, as far as they are made."""
        return len(self.cameras) * self.width * self._lines

    def _for_each(self, of_images: bool, of_rays: bool) -> list[bool]:
        return [of_images] * len(self.cameras) + [of_rays] * len(self._sectors)

    def _distances(self, depth: Float[Array, "W n"]) -> Mapping[str, Float[Array, "W N"]]:
        """Along the rays of each pattern, from the depths of all sectors."""
        found = {name: jnp.full((depth.shape[0], count), jnp.inf) for name, count in self._patterns.items()}
        at = 0
        for sector in self._sectors:
            rows = slice(at, at + len(sector.rays))
            of_sector = sector.distances(depth[:, rows])
            found[sector.pattern] = found[sector.pattern].at[:, sector.rays].set(of_sector)
            at = rows.stop
        return found

    def _order_rays(self) -> bool:
        """Lets each block of threads cast the rays of a tile, which meet the same geoms; says whether it can."""
        contexts, pixels = list(self._context._contexts.values()), self._lines * self.width
        if self._lines % TILE or self.width % TILE:
            return False
        tiles = np.arange(pixels).reshape(self._lines // TILE, TILE, self.width // TILE, TILE).swapaxes(1, 2).ravel()
        order = (np.arange(len(self.cameras))[:, None] * pixels + tiles).ravel()
        for context in contexts:
            for rays in (context.ray, context.ray_offset):
                if len(rays) >= len(order):  # behind those of images are those of patterns
                    old = rays.numpy()
                    rays.assign(np.concatenate([old[order], old[len(order) :]]))
        return True

    def _rows(self, pixels: Array, nothing: int = 0) -> Array:
        """Images [W, C, Y, X] of what the rays saw, in the order in which they are cast. `nothing`: in other rows."""
        shape = (self.engine.num_worlds, len(self.cameras))
        if self._tiled:
            pixels = pixels.reshape(*shape, self._lines // TILE, self.width // TILE, TILE, TILE).swapaxes(3, 4)
        seen, (top, bottom) = pixels.reshape(*shape, self._lines, self.width), self._shown
        if self._lines == self.height:
            seen = seen[:, :, top:bottom]
        return jnp.pad(seen, ((0, 0), (0, 0), (top, self.height - bottom), (0, 0)), constant_values=nothing)

    def _check_addresses(self) -> None:
        """Images, and then rays, lie one after the other in the ray caster's buffers."""
        context = self._context
        sizes = np.array([self.width * self._lines] * len(self.cameras) + [len(s.rays) for s in self._sectors])
        made = [np.array(self._for_each(w, r)) for w, r in zip(self._wants, (False, True, False), strict=True)]
        for address, which in zip((context.rgb_adr, context.depth_adr, context.seg_adr), made, strict=True):
            expected = np.cumsum(np.where(which, sizes, 0)) - sizes
            assert (address.numpy()[which] == expected[which]).all()

    def _plan(self, host: mujoco.MjModel) -> None:
        """Constants of the model, on the host."""
        slots = self.slots
        known, count = self.engine.scene.model.ngeom, host.ngeom - slots
        owners = visual_owners(self.engine.scene, host, count)
        self._owner = np.concatenate([self.model.tables.geom_object, owners, np.full(slots, -1)])
        self._followers = Followers(self.engine.scene, host)
        start = mujoco.MjData(host)
        mujoco.mj_forward(host, start)
        self._added = _f32(start.geom_xpos[known:count]), _f32(start.geom_xmat[known:count]).reshape(-1, 3, 3)
        self._rgba, self._mean = _f32(host.geom_rgba), mean_colours(host, np.arange(host.ngeom))
        self._material = np.array(host.geom_matid, np.int32)
        self._in_tint, self._lamps = tinted_materials(host, STATES), lamp_geoms(host)
        self._size = np.array(host.geom_size, np.float32)
        self._camera_in_body = (host.cam_bodyid, _f32(host.cam_pos), _f32(host.cam_quat))
        self._light_in_body = (host.light_bodyid, _f32(host.light_pos), _f32(host.light_dir))

    def _moved(
        self,
        physics: MjxPhysics,
        slots: Slots,
        eyes: Mapping[str, Pose],
        rendered: Bool[Array, "W"] | None,
        draw: Draw,
    ) -> Any:
        """Render data [W] with everything where physics has it, and cameras out of the way where nothing is drawn."""
        data, worlds = physics.data, self.engine.num_worlds
        body, pos, quat = self._camera_in_body
        own = physics.fields
        pos = jnp.asarray(pos if own.cam_pos is None else own.cam_pos)
        quat = jnp.asarray(quat if own.cam_quat is None else own.cam_quat)
        camera_pos, camera_quat = compose(data.xpos[:, body], data.xquat[:, body], pos, quat)
        of_cameras = {name: pose for name, pose in eyes.items() if name not in self._patterns}
        of_sectors = {sector.camera: sector.pose(dict(eyes)) for sector in self._sectors}
        for name, (eye_pos, eye_quat) in {**of_cameras, **of_sectors}.items():
            camera = camera_id(self._host, name)
            camera_pos, camera_quat = camera_pos.at[:, camera].set(eye_pos), camera_quat.at[:, camera].set(eye_quat)
        if rendered is not None:
            there = jnp.asarray(rendered)[:, None, None]
            camera_pos = jnp.where(there, camera_pos, jnp.asarray(ABOVE))
            camera_quat = jnp.where(there, camera_quat, jnp.asarray(UPWARDS))
        body, pos, direction = self._light_in_body
        light_quat = data.xquat[:, body]
        light_pos = data.xpos[:, body] + quat_rotate(light_quat, jnp.asarray(pos))
        light_dir = quat_rotate(light_quat, jnp.asarray(direction))
        if self._lit and draw.light_quat is not None:
            light_dir = quat_rotate(self._of_lights(draw.light_quat), light_dir)
        added_pos, added_mat = self._of_looks(data)
        spread = jax.vmap(lambda time: self._template.replace(time=time))(jnp.zeros(worlds, jnp.float32))
        return spread.tree_replace(
            {
                "geom_xpos": jnp.concatenate([data.geom_xpos, *added_pos, slots.pos], axis=1),
                "geom_xmat": jnp.concatenate([data.geom_xmat, *added_mat, slots.rotation], axis=1),
                "cam_xpos": camera_pos,
                "cam_xmat": quat_to_matrix(camera_quat),
                "_impl.light_xpos": light_pos,
                "_impl.light_xdir": light_dir,
            }
        )

    def _of_looks(self, data: Any) -> tuple[list[Array], list[Array]]:
        """Poses [W, E, ...] of what the looks add, as the only member of each list; empty where they add nothing."""
        pos, axes = (jnp.broadcast_to(jnp.asarray(a), (self.engine.num_worlds, *a.shape)) for a in self._added)
        if not pos.shape[1]:
            return [], []
        if len(self._followers):
            at = self._followers.geoms - self.engine.scene.model.ngeom
            own_pos, own_axes = self._followers.poses(data.xpos, quat_to_matrix(data.xquat), jnp)
            pos, axes = pos.at[:, at].set(own_pos), axes.at[:, at].set(own_axes)
        return [pos], [axes]

    def _look(self, physics: MjxPhysics, states: ExtendedStates, slots: Slots) -> dict[str, Array]:
        """Fields of the model that differ per world: colour and material of tinted geoms, size and colour of slots,
        and which lamps are on."""
        worlds, geoms = self.engine.num_worlds, len(self._mean) - self.slots
        tint = tints_of_geoms(tints(self.model, states), self._owner[:geoms])
        own = physics.fields.geom_rgba
        fields, base = physics.fields, jnp.asarray(self._material[:geoms])
        if fields.geom_matid is not None:
            base = jnp.broadcast_to(base, (worlds, geoms)).at[:, : fields.geom_matid.shape[-1]].set(fields.geom_matid)
        rgba = jnp.broadcast_to(jnp.asarray(self._rgba[:geoms]), (worlds, geoms, 4))
        if own is not None:
            rgba = rgba.at[:, : own.shape[-2]].set(own)
        mean = jnp.asarray(self._mean[:geoms])
        in_tint = jnp.concatenate([tinted(mean[:, :3], tint), jnp.broadcast_to(mean[:, 3:], (*tint.shape, 1))], axis=-1)
        rgba = jnp.where((tint == UNTINTED)[..., None], rgba, in_tint)
        of_slots = jnp.concatenate([slots.colour, jnp.ones_like(slots.colour[..., :1])], axis=-1)
        material = jnp.where(tint == UNTINTED, base, -1)
        if (self._in_tint >= 0).any():
            in_tint = jnp.asarray(self._in_tint[:, :geoms])[jnp.maximum(tint, 0), jnp.arange(geoms)]
            textured = (tint != UNTINTED) & (in_tint >= 0)
            material = jnp.where(textured, in_tint, material)
            rgba = jnp.where(textured[..., None], jnp.asarray(OF_MATERIAL), rgba)
        plain = jnp.full((worlds, self.slots), -1, material.dtype)
        size = jnp.broadcast_to(jnp.asarray(self._size[:geoms]), (worlds, geoms, 3))
        look: dict[str, Array] = {
            "geom_rgba": jnp.concatenate([rgba, of_slots], axis=1),
            "geom_matid": jnp.concatenate([material, plain], axis=1),
            "geom_size": jnp.concatenate([size, slots.size], axis=1),
        }
        if (own := fields.mat_rgba) is not None:
            added = jnp.broadcast_to(
                self._model.mat_rgba[own.shape[-2] :], (worlds, self._host.nmat - own.shape[-2], 4)
            )
            look["mat_rgba"] = jnp.concatenate([own, added], axis=1)
        if self._lamps:
            lights, of = (np.array(column) for column in zip(*self._lamps, strict=True))
            on = jnp.broadcast_to(self._model.light_active, (worlds, self._host.nlight))
            look["light_active"] = on.at[:, lights].set(tint[:, of] == SWITCHED_ON)
        return look

    def _of_draw(self, draw: Draw) -> dict[str, Array]:
        """Fields of the model that lights and fields of view are."""
        found = {}
        if self._lit:
            colour = jnp.ones((self.engine.num_worlds, 1, 3)) if draw.light_colour is None else draw.light_colour
            of_lights = jnp.asarray(self._of_lights(colour))
            if draw.light_colour is None:  # no spare ones
                of_lights = of_lights.at[:, self._draw_of_light > self.engine.scene.model.nlight].set(0.0)
            at_camera = np.arange(self._host.nlight)[:, None] == self._camera_light
            for name in ("light_diffuse", "light_specular", "light_ambient"):
                found[name] = jnp.where(at_camera, of_lights, getattr(self._model, name) * of_lights)
        if self._zooms and draw.camera_slope is not None:
            wide = jnp.ones((self.engine.num_worlds, self._host.ncam))
            found["cam_fovy"] = wide.at[:, np.array(self.cameras, int)].set(draw.camera_slope[:, None])
        return found

    def _of_lights(self, drawn: Float[Array, "W N k"]) -> Float[Array, "W L k"]:
        """What is drawn of lights, in the order of the render model's."""
        at = self._draw_of_light if drawn.shape[1] > 1 else np.zeros(self._host.nlight, int)
        return drawn[:, at]

    def _objects(self, geom: Int[Array, "W N"], slots: Slots) -> Int[Array, "W N"]:
        """Objects of the geoms that are seen."""
        geoms = len(self._mean) - self.slots
        owner = jnp.asarray(self._owner, jnp.int32)[jnp.clip(geom, 0, geoms - 1)]
        if self.slots:
            particle = jnp.take_along_axis(slots.owner, jnp.clip(geom - geoms, 0, self.slots - 1), axis=1)
            owner = jnp.where(geom >= geoms, particle, owner)
        return jnp.where(geom >= 0, owner, NOTHING)


def _unpack(packed: Array) -> Array:
    """Colour channels of the ray caster's packed pixels: red in bits 16-23, green in 8-15, blue in 0-7."""
    return jnp.stack([(packed >> shift) & 0xFF for shift in (16, 8, 0)], axis=-1).astype(jnp.uint8)


def _f32(array: np.ndarray) -> np.ndarray:
    return np.array(array, np.float32)
