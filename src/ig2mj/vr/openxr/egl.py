"""`EglGraphics`: images of a home for an OpenXR runtime that takes OpenGL from EGL (XR_MNDX_egl_enable: Monado)."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
from jaxtyping import Float

from ig2mj.errors import EngineError
from ig2mj.scene.scene import Scene
from ig2mj.vr.openxr.devices import load_xr
from ig2mj.vr.stereo import Eye, StereoImages

SRGB8_ALPHA8, RGBA8 = 0x8C43, 0x8058
"""OpenGL's formats. MuJoCo's images are already in display encoding, as the first format says; they are copied, so
that nothing converts them."""


class EglGraphics:
    """See `devices.Graphics`. Everything is done by the thread that makes it."""

    extension = "XR_MNDX_egl_enable"

    def __init__(self, scene: Scene):
        """Nothing is rendered before a session reports the size of its images."""
        self._scene, self._pictures, self._chains = scene, None, []

    def check(self, instance: Any, system: Any) -> None:
        """OpenXR wants to be asked for the version of OpenGL before a session."""
        xr = load_xr()
        call = ctypes.cast(
            xr.get_instance_proc_addr(instance, "xrGetOpenGLGraphicsRequirementsKHR"),
            xr.PFN_xrGetOpenGLGraphicsRequirementsKHR,
        )
        result = xr.check_result(xr.Result(call(instance, system, ctypes.byref(xr.GraphicsRequirementsOpenGLKHR()))))
        if result.is_exception():
            raise result
        self._pictures = StereoImages(self._scene)  # with the context that the session will be of

    def binding(self) -> Any:
        """Of the context that is current."""
        xr = load_xr()
        from mujoco.egl import egl_ext as EGL

        found = EGL.eglGetCurrentContext()
        if not found:
            raise EngineError("images for a headset need EGL (MUJOCO_GL=egl)")
        library = ctypes.CDLL("libEGL.so.1")
        address = ctypes.cast(library.eglGetProcAddress, ctypes.c_void_p)
        made = xr.GraphicsBindingEGLMNDX()
        made.get_proc_address = ctypes.cast(address, type(made.get_proc_address))
        made.display, made.context = EGL.eglGetCurrentDisplay(), found
        self._binding = made
        return made

    def begin(self, session: Any, sizes: list[tuple[int, int]]) -> None:
        """A swapchain for each eye."""
        xr = load_xr()
        assert self._pictures is not None
        (width, height), *_ = sizes
        self._pictures.resize(width, height)
        offered = [int(f) for f in xr.enumerate_swapchain_formats(session)]
        chosen = next((f for f in (SRGB8_ALPHA8, RGBA8) if f in offered), None)
        if chosen is None:
            raise EngineError(f"the OpenXR runtime supports none of our image formats; it takes {offered}")
        for _ in range(2):
            info = xr.SwapchainCreateInfo(
                usage_flags=xr.SwapchainUsageFlags.COLOR_ATTACHMENT_BIT | xr.SwapchainUsageFlags.TRANSFER_DST_BIT,
                format=chosen,
                sample_count=1,
                width=width,
                height=height,
                face_count=1,
                array_size=1,
                mip_count=1,
            )
            chain = xr.create_swapchain(session, info)
            images = xr.enumerate_swapchain_images(chain, xr.SwapchainImageOpenGLKHR)
            self._chains.append((chain, [int(image.image) for image in images]))

    def draw(self, poses: Float[np.ndarray, "B 7"], eyes: tuple[Eye, Eye]) -> None:
        """Draws both eyes; `layers` hands them over."""
        assert self._pictures is not None
        self._pictures.draw(poses, eyes)

    def layers(self, space: Any, views: Any) -> list[Any]:
        """One layer: what was drawn last, for the views that it was drawn for."""
        xr = load_xr()
        assert self._pictures is not None
        width, height = self._pictures.width, self._pictures.height
        shown = []
        for eye, (chain, images) in enumerate(self._chains):
            number = xr.acquire_swapchain_image(chain, xr.SwapchainImageAcquireInfo())
            xr.wait_swapchain_image(chain, xr.SwapchainImageWaitInfo(timeout=xr.INFINITE_DURATION))
            self._pictures.copy_to(images[int(number)], eye)
            xr.release_swapchain_image(chain, xr.SwapchainImageReleaseInfo())
            part = xr.SwapchainSubImage(chain, xr.Rect2Di(xr.Offset2Di(0, 0), xr.Extent2Di(width, height)), 0)
            shown.append(xr.CompositionLayerProjectionView(views[eye].pose, views[eye].fov, part))
        self._shown = (xr.CompositionLayerProjectionView * 2)(*shown)
        self._layer = xr.CompositionLayerProjection(space=space, view_count=2, views=self._shown)
        return [ctypes.pointer(self._layer)]

    def close(self) -> None:
        """Lets go of OpenGL; may be called twice."""
        if self._pictures is not None:
            self._pictures.close()
