"""What pages see: the home as nodes of viser's scene, of which only what changed is sent.

A body is a node with its geometry; a pose is two short messages, geometry is sent once, and again only when its
object's colour changes. Dust and stains hang on their bodies, so that they move for free.

Axis: B bodies.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

import mujoco
import numpy as np
import viser
from jaxtyping import Float

from ig2mj.geometry.poses import quat_to_matrix
from ig2mj.looks import Visual, visual_of
from ig2mj.looks.light import Bulb, Light, linear_lights
from ig2mj.scene.scene import Scene
from ig2mj.sensors.render_model import BACKGROUND
from ig2mj.states.definitions.water import DROP_RADIUS
from ig2mj.viewer.offscreen import FreeView
from ig2mj.viewer.overlays import ObjectNames, RoomNames
from ig2mj.viewer.overview import home_overview
from ig2mj.viewer.state_marks import Mark
from ig2mj.web.geometry import PLAIN, Look, glb_of_geoms, visual_geoms
from ig2mj.web.looks import WATER_COLOUR, Patches

MOVED = 1e-5
"""Metres, and parts of a quaternion: what differs less is not sent."""

ROBOT_HEIGHT, ROBOT_DISTANCE = 0.8, 4.5
"""Metres: what a page looks at first where there is a robot, and from how far."""

SKY, GROUND, SUN = (255, 255, 255), (170, 165, 160), (255, 250, 240)
"""Colours of the light from above, from below, and of the sun."""

SKY_LIGHT, SUN_LIGHT, SUN_FROM = 1.9, 1.0, (3.0, -4.0, 8.0)
"""three.js's intensities, with which a white wall is just not white, and where the sun stands."""

LAMP_END, LAMP_MOVED = 6.0, 0.1
"""m to which lamps light what moves, and by which a lamp moves before its light on the home is sent again."""

BUILDING = frozenset({"walls", "floors", "ceilings"})
"""Categories that no click is for: they are behind everything."""

Click = Callable[[int], None]
Pull = Callable[[Any, int, Any], None]


class Stage:
    """The nodes of a home.

    Attributes: sent: poses that were sent so far, and geometries.
    """

    def __init__(
        self, server: viser.ViserServer, scene: Scene, on_click: Click, on_drag: Pull | None, looks: str | None = None
    ):
        """Sends the home as it starts.

        Args:
          on_click: called with the object that is clicked. on_drag: called with viser's event, a body, and the event's
            node, while a movable body is dragged; None: nothing can be dragged.
          looks: how the home is shown; None: the scene's own.
        """
        self._server, self._scene, self._visual = server, scene, visual_of(scene, looks)
        self._model = self._visual.model
        self._on_click, self._on_drag = on_click, on_drag
        start = scene.start_data()
        self._pos, self._quat = start.xpos.copy(), start.xquat.copy()
        self._geoms: dict[int, list[int]] = {}
        drawn = _drawn(scene, self._visual)
        for g in (g for g in drawn if g < scene.model.ngeom):
            self._geoms.setdefault(int(self._model.geom_bodyid[g]), []).append(g)
        self._looks: dict[int, Look] = {}
        self._plain: dict[int, bytes] = {}
        self._patches: dict[tuple[str, int], tuple[Patches, Any]] = {}
        self._drops: Any = None
        self._marks: dict[str, Any] = {}
        self._bulbs: dict[int, Bulb] = {}
        self._names: list[Any] = []
        self._rooms: list[Any] = []
        self._line: Any = None
        self._costumes: list[Any] = []
        self.sent = {"poses": 0, "geometries": 0}
        owner = np.asarray(scene.tables.body_object)
        self._object_of = {body: int(owner[body]) for body in range(scene.model.nbody)}
        self._prepare()
        self._nodes = {body: self._add_body(body) for body in sorted(self._geoms)}
        self._add_decoration([g for g in drawn if g >= scene.model.ngeom])
        self._view(start)

    def _prepare(self) -> None:
        scene = self._server.scene
        # No environment map: where a browser draws in software, preparing one takes longer than all the rest.
        scene.configure_environment_map(None)
        scene.configure_default_lights(enabled=False)
        if self._visual.light is None:
            scene.add_light_hemisphere("/light/sky", sky_color=SKY, ground_color=GROUND, intensity=SKY_LIGHT)
            sun: dict[str, Any] = {"color": SUN, "intensity": SUN_LIGHT, "position": SUN_FROM}
            scene.add_light_directional("/light/sun", **sun, cast_shadow=False)
        else:
            self._light(self._visual.light)
        colour = np.round(np.array(BACKGROUND[:3]) * 255).astype(np.uint8)
        scene.set_background_image(np.tile(colour, (4, 4, 1)), format="png")
        scene.world_axes.visible = False

    def _light(self, light: Light) -> None:
        """Lights of the page for what turns; on all else light is computed before it is sent."""
        ambient, lamps = linear_lights(light)
        power = max(float(ambient.max()), 1e-6)
        self._server.scene.add_light_ambient("/light/all", color=_rgb(tuple(ambient / power)), intensity=power * np.pi)
        for k, ((direction, _), colour) in enumerate(zip(light.lamps, lamps, strict=True)):
            power = max(float(colour.max()), 1e-6)
            place = -10 * np.asarray(direction) / np.linalg.norm(direction)
            lamp: dict[str, Any] = {"color": _rgb(tuple(colour / power)), "intensity": power * np.pi}
            self._server.scene.add_light_directional(f"/light/{k}", **lamp, position=tuple(place), cast_shadow=False)

    def _add_decoration(self, geoms: list[int]) -> None:
        """What looks add to the home: one node, which no click is for."""
        followers = self._visual.followers
        still = [g for g in geoms if g not in set(followers.geoms.tolist())]
        shown: dict[str, Any] = {"cast_shadow": False, "receive_shadow": False}
        self._still, self._decoration = still, None
        if still:
            content = glb_of_geoms(self._model, still, light=self._visual.light)
            self._decoration = self._server.scene.add_glb("/decoration", content, **shown)
        for g in followers.geoms.tolist():
            content = glb_of_geoms(self._model, [g], frames={g: (np.zeros(3), np.array([1.0, 0, 0, 0]))})
            self._costumes.append(self._server.scene.add_glb(f"/costume{g}", content, **shown))
        self._move_costumes()

    def _move_costumes(self) -> None:
        """Sends where the robots' costumes are."""
        if not self._costumes:
            return
        axes = np.asarray(quat_to_matrix(self._quat))
        pos, turned = (a[0] for a in self._visual.followers.poses(self._pos[None], axes[None]))
        for k, node in enumerate(self._costumes):
            quat = np.zeros(4)
            mujoco.mju_mat2Quat(quat, turned[k].ravel())
            node.position, node.wxyz = pos[k], quat

    def _glb(self, body: int, look: Look = PLAIN) -> bytes:
        """A body's geometry. Light is computed here for those that never turn."""
        turns = self._scene.model.body_weldid[body] != 0
        turn = np.asarray(quat_to_matrix(self._quat[body]))
        light = None if turns else self._visual.light
        bulbs, place = list(self._bulbs.values()), self._pos[body]
        return glb_of_geoms(self._model, self._geoms[body], look, light=light, turn=turn, place=place, bulbs=bulbs)

    def _view(self, data: mujoco.MjData) -> None:
        """Where pages look from at first: the whole home, or a robot in it, over its shoulder."""
        view, agents = home_overview(self._scene, data), self._scene.tables.agent_body
        if len(agents):
            base, turn = data.xpos[agents[0]], data.xmat[agents[0]].reshape(3, 3)
            ahead = float(np.degrees(np.arctan2(turn[1, 0], turn[0, 0])))
            place = (float(base[0]), float(base[1]), ROBOT_HEIGHT)
            view = FreeView(place, ROBOT_DISTANCE, ahead + 35.0, -50.0)
        azimuth, elevation = np.radians(view.azimuth), np.radians(view.elevation)
        flat = np.cos(elevation)
        forward = np.array([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)])
        camera, at = self._server.initial_camera, np.asarray(view.lookat, float)
        camera.position, camera.look_at = tuple(at - 0.95 * view.distance * forward), tuple(at)
        camera.fov = float(np.radians(45))
        camera.near, camera.far = 0.05, 500.0

    # Bodies.

    def _add_body(self, body: int) -> Any:
        """One node has the pose and the geometry: a page takes 3 ms of processor time for each."""
        pose: dict[str, Any] = {"position": tuple(self._pos[body]), "wxyz": tuple(self._quat[body])}
        self._plain[body] = self._glb(body)
        shown: dict[str, Any] = {"cast_shadow": False, "receive_shadow": False}
        node = self._server.scene.add_glb(f"/b{body}", self._plain[body], **pose, **shown)
        self.sent["geometries"] += 1
        self._listen(body, node)
        return node

    def _draw(self, body: int, look: Look) -> None:
        """Sends a body's geometry again, with other materials."""
        self._nodes[body].glb_data = self._plain[body] if look == PLAIN else self._glb(body, look)
        self.sent["geometries"] += 1

    def _listen(self, body: int, node: Any) -> None:
        """Takes clicks on a body, and drags where it can move."""
        obj = self._object_of[body]
        if obj < 0 or self._scene.tables.object_categories[obj] in BUILDING:
            return

        @node.on_click
        async def _(event: Any) -> None:
            self._on_click(obj)

        if self._on_drag is None or self._scene.model.body_weldid[body] == 0:
            return
        on_drag = self._on_drag

        @node.on_drag("left")
        async def _(event: Any) -> None:
            on_drag(event, body, node)

    def move(self, pos: Float[np.ndarray, "B 3"], quat: Float[np.ndarray, "B 4"]) -> int:
        """Sends the poses that changed, world frame; says how many."""
        good = np.isfinite(pos).all(1) & np.isfinite(quat).all(1)
        moved = good & (np.abs(pos - self._pos).max(1) > MOVED) | good & (np.abs(quat - self._quat).max(1) > MOVED)
        bodies = [b for b in np.flatnonzero(moved).tolist() if b in self._nodes]
        with self._server.atomic():
            for body in bodies:
                node = self._nodes[body]
                node.position, node.wxyz = pos[body], quat[body]
            self._pos[moved], self._quat[moved] = pos[moved], quat[moved]
            if moved.any():
                self._move_costumes()
        self.sent["poses"] += len(bodies)
        return len(bodies)

    # States.

    def colour(self, looks: Mapping[int, Look]) -> None:
        """Gives objects their looks; those that are not named look plain."""
        for body in self._geoms:
            look = looks.get(self._object_of[body], PLAIN)
            if look != self._looks.get(body, PLAIN):
                self._looks[body] = look
                self._draw(body, look)

    def switch(self, on: Collection[int]) -> None:
        """Lets lamps light the home: of these objects, and no others. What stands still is sent again."""
        if self._visual.light is None:
            return
        bulbs = {}
        for light in self._visual.lamps:
            body = int(self._model.light_bodyid[light])
            if self._object_of[body] in on:
                bulbs[light] = self._bulb(light, body)
        if self._bulbs.keys() == bulbs.keys() and all(_near(self._bulbs[k].pos, bulbs[k].pos) for k in bulbs):
            return
        for light in self._bulbs.keys() | bulbs.keys():
            self._server.scene.remove_by_name(f"/light/lamp{light}")
        self._bulbs = bulbs
        for light, bulb in bulbs.items():
            power = max(bulb.rgb)
            lamp: dict[str, Any] = {
                "color": _rgb(_unit(bulb.rgb)),
                "intensity": 0.5 * power * np.pi,
                "distance": LAMP_END,
            }
            self._server.scene.add_light_point(f"/light/lamp{light}", **lamp, position=bulb.pos)
        still = [body for body in self._geoms if self._scene.model.body_weldid[body] == 0]
        with self._server.atomic():
            for body in still:
                self._plain[body] = self._glb(body)
                self._draw(body, self._looks.get(body, PLAIN))
            if self._decoration is not None:
                light = self._visual.light
                self._decoration.glb_data = glb_of_geoms(
                    self._model, self._still, light=light, bulbs=list(bulbs.values())
                )

    def _bulb(self, light: int, body: int) -> Bulb:
        turn = np.asarray(quat_to_matrix(self._quat[body]))
        pos = self._pos[body] + turn @ self._model.light_pos[light]
        rgb, reach = self._model.light_diffuse[light], self._model.light_attenuation[light]
        return Bulb(tuple(pos.tolist()), tuple(rgb.tolist()), tuple(reach.tolist()))

    def mark(self, marks: Sequence[Mark]) -> None:
        """Shows steam, smoke, frost, drops and glow, world frame; what is not named is gone."""
        for name, kind in (("blocks", True), ("balls", False)):
            here = [m for m in marks if (m.kind == mujoco.mjtGeom.mjGEOM_BOX) == kind]
            node = self._marks.get(name)
            if node is not None and len(node.batched_positions) != len(here):
                self._marks.pop(name).remove()
                node = None
            if not here:
                continue
            pos = np.array([m.pos for m in here], np.float32)
            scale = np.array([(*m.size, *m.size[-1:] * (3 - len(m.size))) for m in here], np.float32)
            rgba = np.array([m.rgba for m in here], np.float32)
            if node is not None:
                with self._server.atomic():
                    node.batched_positions, node.batched_scales, node.batched_opacities = pos, scale, rgba[:, 3]
                continue
            vertices, faces = _block() if kind else _ball()
            self._marks[name] = self._server.scene.add_batched_meshes_simple(
                f"/effects/{name}",
                vertices,
                faces,
                batched_positions=pos,
                batched_wxyzs=np.array([_quat(m.axes) for m in here], np.float32),
                batched_scales=scale,
                batched_colors=np.round(255 * rgba[:, :3]).astype(np.uint8),
                batched_opacities=rgba[:, 3],
                lod="off",
                flat_shading=kind,
                cast_shadow=False,
                receive_shadow=False,
            )

    def dirty(self, patches: Mapping[tuple[str, int], Patches]) -> None:
        """Shows dust and stains; what is not named is clean."""
        for key in [k for k in self._patches if k not in patches]:
            self._patches.pop(key)[1].remove()
        for (kind, body), new in patches.items():
            old = self._patches.get((kind, body))
            if old is not None and all(np.array_equal(getattr(old[0], n), getattr(new, n)) for n in ("pos", "scale")):
                continue
            vertices, faces = _ball() if new.round else _block()
            node = self._server.scene.add_batched_meshes_simple(
                f"/b{body}/{kind}" if body in self._geoms else f"/{kind}_b{body}",
                vertices,
                faces,
                batched_positions=new.pos.astype(np.float32),
                batched_wxyzs=new.quat.astype(np.float32),
                batched_scales=new.scale.astype(np.float32),
                batched_colors=_rgb(new.rgb),
                lod="off",
                flat_shading=not new.round,
                cast_shadow=False,
                receive_shadow=False,
            )
            self._patches[kind, body] = (new, node)

    def rain(self, drops: Float[np.ndarray, "N 3"]) -> None:
        """Shows water drops in the air, world frame."""
        if len(drops) == 0:
            if self._drops is not None:
                self._drops.remove()
                self._drops = None
            return
        turned = np.tile(np.array([1, 0, 0, 0], np.float32), (len(drops), 1))
        if self._drops is None or len(self._drops.batched_positions) != len(drops):
            vertices, faces = _ball()
            self._drops = self._server.scene.add_batched_meshes_simple(
                "/drops",
                vertices,
                faces,
                batched_positions=drops,
                batched_wxyzs=turned,
                batched_scales=np.full(len(drops), DROP_RADIUS, np.float32),
                batched_colors=_rgb(WATER_COLOUR),
                lod="off",
                cast_shadow=False,
                receive_shadow=False,
            )
        elif not np.array_equal(self._drops.batched_positions, drops):
            self._drops.batched_positions = drops

    # What is written, and the spring.

    def write_names(self, shown: bool) -> None:
        """Names above objects, or none."""
        if shown and not self._names:
            data = self._scene.start_data()
            for label in ObjectNames(self._scene).labels(data):
                body = int(self._scene.tables.object_root[self._scene.object_index(label.text)])
                if body not in self._geoms:
                    continue
                turn = data.xmat[body].reshape(3, 3)
                place = turn.T @ (np.array(label.pos) - data.xpos[body])
                self._names.append(self._server.scene.add_label(f"/b{body}/name", label.text, position=tuple(place)))
        for node in self._names:
            node.visible = shown

    def write_rooms(self, shown: bool) -> None:
        """Names of rooms on their floors, or none."""
        if shown and not self._rooms:
            for k, label in enumerate(RoomNames(self._scene).labels(self._scene.start_data())):
                self._rooms.append(self._server.scene.add_label(f"/room{k}", label.text, position=label.pos))
        for node in self._rooms:
            node.visible = shown

    def spring(self, ends: Float[np.ndarray, "N 2 3"]) -> None:
        """Lines from what is dragged to the pointers, world frame."""
        if len(ends) == 0:
            if self._line is not None:
                self._line.remove()
                self._line = None
        elif self._line is None or len(self._line.points) != len(ends):
            self._line = self._server.scene.add_line_segments(
                "/spring", ends.astype(np.float32), colors=(230, 80, 20), thickness=0.01
            )
        else:
            self._line.points = ends.astype(np.float32)


def _drawn(scene: Scene, visual: Visual) -> list[int]:
    """Visual geoms, and the collision geoms of objects that have none."""
    model, owner = visual.model, visual.owner
    seen = visual_geoms(model)
    without = set(range(scene.tables.num_objects)) - set(owner[seen].tolist())
    others = visual_geoms(model, (3,))
    return sorted([*seen.tolist(), *(g for g in others.tolist() if int(owner[g]) in without)])


def _rgb(colour: tuple[float, float, float]) -> tuple[int, int, int]:
    r, g, b = (round(255 * c) for c in colour)
    return r, g, b


def _unit(rgb: tuple[float, ...]) -> tuple[float, float, float]:
    """The colour at its brightest."""
    r, g, b = (c / max(*rgb, 1e-6) for c in rgb)
    return r, g, b


def _near(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
    """Whether light from both places looks the same."""
    return float(np.abs(np.subtract(a, b)).max()) < LAMP_MOVED


def _quat(axes: Float[np.ndarray, "3 3"]) -> np.ndarray:
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, np.ascontiguousarray(axes, float).ravel())
    return quat


def _ball() -> tuple[np.ndarray, np.ndarray]:
    from trimesh import creation

    ball = creation.icosphere(subdivisions=1)
    return ball.vertices.astype(np.float32), ball.faces.astype(np.uint32)


def _block() -> tuple[np.ndarray, np.ndarray]:
    from trimesh import creation

    block = creation.box(extents=(2, 2, 2))
    return block.vertices.astype(np.float32), block.faces.astype(np.uint32)
