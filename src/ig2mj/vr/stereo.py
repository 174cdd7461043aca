"""`StereoImages`: a home drawn for both eyes with OpenGL, without a display and without physics.

    images = StereoImages(scene, 1296, 1440)
    images.draw(track.at(), eyes)
    left, right = images.read()

Poses of bodies come from `vr.track` or another source; nothing is simulated here. One thread makes, uses and closes
it: OpenGL belongs to that thread.
"""

from __future__ import annotations

import copy
import dataclasses
import math

import mujoco
import numpy as np
from jaxtyping import Bool, Float, UInt8
from scipy.spatial.transform import Rotation

from ig2mj.geometry.frustum import spheres_in_view
from ig2mj.looks import visual_of
from ig2mj.looks.visual import FARTHEST
from ig2mj.process.opengl import images_of, use_opengl
from ig2mj.scene.geom_groups import HIDDEN_GROUP, VISIBLE_GROUPS
from ig2mj.scene.scene import Scene
from ig2mj.vr.frames import Pose

WIDTH, HEIGHT = 1296, 1440
"""Pixels of each eye (iGibson's VR settings)."""

NEAR, FAR = 0.1, FARTHEST
"""m."""

SAMPLES = 4
"""Of each pixel."""

SHADOW_REACH = 10.0
"""m. What is further from the place where its shadow would fall is not drawn for the shadow's sake."""

_CAMERA_AXES = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""MuJoCo's camera axes (right, up, back) as columns in an eye's (forward, left, up)."""


@dataclasses.dataclass(frozen=True, eq=False)
class Eye:
    """One eye: its pose in the world (x forward, z up), and angles of view, rad: left and down are negative."""

    pose: Pose
    left: float
    right: float
    up: float
    down: float


class StereoImages:
    """See the module's text. Attributes: width, height: pixels of one eye. context: MuJoCo's OpenGL context."""

    def __init__(self, scene: Scene, width: int = WIDTH, height: int = HEIGHT, samples: int = SAMPLES):
        """Uploads the home.

        Raises:
          MissingDependencyError: no OpenGL without a display works here.
        """
        use_opengl()
        from mujoco.rendering.classic import gl_context

        self.width, self.height, self._copy = width, height, None
        visual = visual_of(scene)
        self._model = model = copy.copy(visual.model)
        self._known, self._followers = scene.model.ngeom, visual.followers
        model.vis.global_.offwidth, model.vis.global_.offheight = 2 * width, height
        model.vis.quality.offsamples = samples
        own = model.geom_bodyid == scene.tables.agent_body[0] if len(scene.tables.agent_body) else False
        model.geom_rgba[own, 3] = 0.0  # nobody sees their own head from inside
        model.geom_matid[own] = -1
        worn = [geom for geom, body in visual.followers.riders.items() if body in scene.tables.agent_body[:1]]
        model.geom_rgba[worn, 3], model.geom_matid[worn] = 0.0, -1
        self._data = mujoco.MjData(model)
        self._data.qpos[:] = scene.start_data().qpos
        mujoco.mj_forward(model, self._data)
        self._geoms = np.flatnonzero(np.isin(model.geom_group, VISIBLE_GROUPS))
        self._groups = model.geom_group[self._geoms]
        self._posed = self._geoms[self._geoms < self._known]  # the rest stands still, or follows bodies
        self._turns = Rotation.from_quat(np.roll(model.geom_quat[self._posed], -1, axis=1))
        self.context = gl_context.GLContext(2 * width, height)
        self.context.make_current()
        with images_of(2 * width, height):
            self.renderer = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self.renderer)
        self._option, self._camera = mujoco.MjvOption(), mujoco.MjvCamera()
        for group in range(mujoco.mjNGROUP):
            self._option.geomgroup[group] = group in VISIBLE_GROUPS
        self._scene = mujoco.MjvScene(model, maxgeom=2 * model.ngeom + 5000)
        self._whole = mujoco.MjrRect(0, 0, 2 * width, height)

    def resize(self, width: int, height: int) -> None:
        """Another size of each eye's image."""
        self.width, self.height = width, height
        mujoco.mjr_resizeOffscreen(2 * width, height, self.renderer)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self.renderer)
        self._whole = mujoco.MjrRect(0, 0, 2 * width, height)

    def draw(self, poses: Float[np.ndarray, "B 7"], eyes: tuple[Eye, Eye]) -> None:
        """Draws both eyes, the left one on the left half.

        Args:
          poses: of all bodies, world: position, w-x-y-z.
        """
        self._place(poses)
        seen = self._seen(eyes[0]) | self._seen(eyes[1])
        self._model.geom_group[self._geoms] = np.where(seen, self._groups, HIDDEN_GROUP)
        scene = self._scene
        category = mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(self._model, self._data, self._option, None, self._camera, category, scene)
        scene.stereo = mujoco.mjtStereo.mjSTEREO_SIDEBYSIDE
        for number, eye in enumerate(eyes):
            _aim(scene.camera[number], eye)
        mujoco.mjr_render(self._whole, scene, self.renderer)

    def read(self) -> UInt8[np.ndarray, "2 h w 3"]:
        """The images drawn last, left and right."""
        pixels = np.empty((self.height, 2 * self.width, 3), np.uint8)
        mujoco.mjr_readPixels(pixels, None, self._whole, self.renderer)
        pixels = pixels[::-1]
        return np.stack([pixels[:, : self.width], pixels[:, self.width :]])

    def copy_to(self, texture: int, eye: int) -> None:
        """Copies the image of eye 0 or 1 into a texture of OpenGL of the same size, which the context owns."""
        from OpenGL import GL

        assert self.renderer is not None
        if self._copy is None:
            self._copy = int(GL.glGenFramebuffers(1))
        left, right = eye * self.width, (eye + 1) * self.width
        GL.glBindFramebuffer(GL.GL_DRAW_FRAMEBUFFER, self._copy)
        GL.glFramebufferTexture2D(GL.GL_DRAW_FRAMEBUFFER, GL.GL_COLOR_ATTACHMENT0, GL.GL_TEXTURE_2D, texture, 0)
        source = self.renderer.offFBO
        if self.renderer.offSamples:  # several samples are first made one, in a buffer of the same size
            GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, source)
            GL.glBindFramebuffer(GL.GL_DRAW_FRAMEBUFFER, self.renderer.offFBO_r)
            area = (0, 0, 2 * self.width, self.height)
            GL.glBlitFramebuffer(*area, *area, GL.GL_COLOR_BUFFER_BIT, GL.GL_NEAREST)
            source = self.renderer.offFBO_r
            GL.glBindFramebuffer(GL.GL_DRAW_FRAMEBUFFER, self._copy)
        GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, source)
        GL.glBlitFramebuffer(
            left, 0, right, self.height, 0, 0, self.width, self.height, GL.GL_COLOR_BUFFER_BIT, GL.GL_NEAREST
        )
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self.renderer)

    def finish(self) -> None:
        """Returns when everything is drawn."""
        mujoco.mjr_finish()

    def close(self) -> None:
        """Lets go of OpenGL; may be called twice."""
        if self.renderer is not None:
            self.renderer.free()
            self.context.free()
            self.renderer = None

    def _seen(self, eye: Eye) -> Bool[np.ndarray, "G"]:
        """Which geoms the eye may see, or shadows of them: MuJoCo itself sends every geom of a home to OpenGL, for each
        eye, and again for shadows."""
        at, model, data = self._data.geom_xpos[self._geoms], self._model, self._data
        ends = [at]
        for light in np.flatnonzero(model.light_castshadow & model.light_active):
            parallel = model.light_type[light] == mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
            way = data.light_xdir[light] if parallel else at - data.light_xpos[light]
            ends.append(at + SHADOW_REACH * way / np.linalg.norm(way, axis=-1, keepdims=True))
        axes = eye.pose.turn.as_matrix() @ _CAMERA_AXES
        slopes = (math.tan(angle) for angle in (eye.left, eye.right, eye.down, eye.up))
        return spheres_in_view((np.stack(ends) - eye.pose.pos) @ axes, model.geom_rbound[self._geoms], *slopes)

    def _place(self, poses: Float[np.ndarray, "B 7"]) -> None:
        """Where the geoms are, from where their bodies are."""
        model, data, geoms = self._model, self._data, self._posed
        bodies = model.geom_bodyid[geoms]
        turns = Rotation.from_quat(np.roll(poses[bodies, 3:], -1, axis=1).astype(np.float64))
        data.geom_xpos[geoms] = poses[bodies, :3] + turns.apply(model.geom_pos[geoms])
        data.geom_xmat[geoms] = (turns * self._turns).as_matrix().reshape(-1, 9)
        if len(self._followers):
            axes = Rotation.from_quat(np.roll(poses[:, 3:], -1, axis=1).astype(np.float64)).as_matrix()
            pos, turned = self._followers.poses(poses[None, :, :3].astype(np.float64), axes[None])
            data.geom_xpos[self._followers.geoms] = pos[0]
            data.geom_xmat[self._followers.geoms] = turned[0].reshape(-1, 9)


def _aim(camera: mujoco.MjvGLCamera, eye: Eye) -> None:
    camera.pos[:] = eye.pose.pos
    camera.forward[:] = eye.pose.turn.apply((1.0, 0.0, 0.0))
    camera.up[:] = eye.pose.turn.apply((0.0, 0.0, 1.0))
    left, right, up, down = (NEAR * math.tan(angle) for angle in (eye.left, eye.right, eye.up, eye.down))
    camera.frustum_center, camera.frustum_width = (left + right) / 2, (right - left) / 2
    camera.frustum_bottom, camera.frustum_top = down, up
    camera.frustum_near, camera.frustum_far = NEAR, FAR
    camera.orthographic = 0
