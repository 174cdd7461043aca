"""An OpenXR runtime for tests: a small shared library that the real loader loads, whose functions are Python's.

It implements what `ig2mj.vr.openxr` uses, with poses, buttons and eyes that a script sets, and looks at what it is
given: bindings, pulses, pictures. Frames are not held back, so that tests are as fast as they can be.
"""

from __future__ import annotations

import ctypes
import json
import os
import pathlib
import shutil
import subprocess
from ctypes import CFUNCTYPE, POINTER, c_char_p, c_int, c_uint32, c_uint64, c_void_p, cast
from typing import Any, ClassVar

import numpy as np
import pytest

from ig2mj.vr.openxr.devices import load_xr

STUB = """
#include <stddef.h>
#include <stdint.h>
typedef int (*get_proc)(uint64_t, const char *, void **);
typedef struct { int type; uint32_t version; size_t size; uint32_t interface; uint64_t api; get_proc get; } request;
static get_proc chosen;
void install(get_proc get) { chosen = get; }
int xrNegotiateLoaderRuntimeInterface(const void *loader, request *answer) {
  (void)loader;
  answer->interface = 1;
  answer->api = ((uint64_t)1 << 48) | ((uint64_t)0 << 32) | 34;
  answer->get = chosen;
  return chosen ? 0 : -2;
}
"""

EXTENSIONS = ("XR_MND_headless", "XR_EXT_eye_gaze_interaction", "XR_MNDX_egl_enable", "XR_KHR_opengl_enable")
PERIOD = 11_111_111
"""ns of a frame."""
RGBA, SRGBA = 0x8058, 0x8C43
"""Formats of OpenGL."""


def build_stub(folder: pathlib.Path) -> pathlib.Path:
    """Compiles the library and its manifest; gives the manifest."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("needs a C compiler")
    source, library = folder / "runtime.c", folder / "libruntime.so"
    source.write_text(STUB)
    subprocess.run([compiler, "-shared", "-fPIC", "-o", str(library), str(source)], check=True)
    manifest = folder / "runtime.json"
    manifest.write_text(json.dumps({"file_format_version": "1.0.0", "runtime": {"library_path": str(library)}}))
    os.environ["XR_RUNTIME_JSON"] = str(manifest)
    return library


class Runtime:
    """The functions, and what they do. `script(runtime, frame)` is called before every frame.

    Attributes:
      head, hands, gaze: poses (position, x-y-z-w) or None. state: of parts by path. views: poses of the eyes.
      pulses: (path of the hand, amplitude, s). bound: part -> name of its action, by profile.
      shown: of each frame that was handed over: pixels of both eyes, or None.
    """

    current: Runtime
    callbacks: ClassVar[dict[str, Any]] = {}
    get: Any = None

    def __init__(
        self, library: pathlib.Path, extensions: tuple[str, ...] = EXTENSIONS, size: tuple[int, int] = (64, 72)
    ):
        xr = load_xr()
        self.xr, self.extensions, self.size = xr, extensions, size
        self.head: Any = ((0.0, 1.6, 0.0), (0.0, 0.0, 0.0, 1.0))
        self.hands: list[Any] = [None, None]
        self.gaze: Any = None
        self.state: dict[str, Any] = {}
        self.pulses: list[tuple[str, float, float]] = []
        self.bound: dict[str, dict[str, str]] = {}
        self.shown: list[Any] = []
        self.script = lambda runtime, frame: None
        self.frames, self.time = 0, 0
        self.profile = "/interaction_profiles/oculus/touch_controller"
        self._paths, self._names = {}, [""]
        self._objects: dict[int, Any] = {}
        self._events: list[int] = []
        self.errors: list[BaseException] = []
        Runtime.current = self
        if not Runtime.callbacks:  # the loader keeps what it was given first
            for name in dir(self):
                if name.startswith("xr") and name != "xr":
                    raw = getattr(xr.raw_functions, name, None)
                    types = raw.argtypes if raw is not None else self._more(name)
                    Runtime.callbacks[name] = CFUNCTYPE(c_int, *types)(_guarded(name))
            Runtime.get = CFUNCTYPE(c_int, c_uint64, c_char_p, POINTER(c_void_p))(_get_proc)
        ctypes.CDLL(str(library)).install(Runtime.get)

    def _more(self, name: str) -> list[Any]:
        assert name == "xrGetOpenGLGraphicsRequirementsKHR"
        return [self.xr.Instance, self.xr.SystemId, POINTER(self.xr.GraphicsRequirementsOpenGLKHR)]

    def _new(self, thing: Any, handle: Any) -> None:
        key = len(self._objects) + 1
        self._objects[key] = thing
        cast(handle, POINTER(c_uint64))[0] = key

    def _of(self, handle: Any) -> Any:
        value = handle if isinstance(handle, int) else cast(handle, c_void_p).value
        return self._objects[value]

    @staticmethod
    def _count(values: list, capacity: int, count: Any, array: Any, fill) -> int:
        count[0] = len(values)
        if capacity:
            for k, value in enumerate(values):
                fill(array[k], value)
        return 0

    def _state_is(self, state: str) -> None:
        self._events.append(int(self.xr.SessionState[state]))

    # Instance.

    def xrEnumerateInstanceExtensionProperties(self, layer, capacity, count, array):
        def fill(entry, name):
            entry.extension_name, entry.extension_version = name.encode(), 1

        return self._count(list(self.extensions), capacity, count, array, fill)

    def xrCreateInstance(self, info, instance):
        self._new("instance", instance)

    def xrDestroyInstance(self, instance):
        pass

    def xrGetInstanceProperties(self, instance, properties):
        properties.contents.runtime_name = b"test"

    def xrPollEvent(self, instance, buffer):
        if not self._events:
            return 4  # XR_EVENT_UNAVAILABLE
        event = cast(buffer, POINTER(self.xr.EventDataSessionStateChanged)).contents
        event._type = int(self.xr.StructureType.EVENT_DATA_SESSION_STATE_CHANGED)
        event._state = self._events.pop(0)
        return 0

    def xrGetSystem(self, instance, info, system):
        cast(system, POINTER(c_uint64))[0] = 1

    def xrGetSystemProperties(self, instance, system, properties):
        properties.contents.system_name = b"A headset of this test"

    def xrGetOpenGLGraphicsRequirementsKHR(self, instance, system, requirements):
        requirements.contents._min_api_version_supported = 4 << 48
        requirements.contents._max_api_version_supported = 5 << 48

    def xrStringToPath(self, instance, text, path):
        name = text.decode()
        if name not in self._paths:
            self._paths[name] = len(self._names)
            self._names.append(name)
        cast(path, POINTER(c_uint64))[0] = self._paths[name]

    def _path(self, path) -> str:
        return self._names[path if isinstance(path, int) else path.value]

    # Session.

    def xrCreateSession(self, instance, info, session):
        self.binding = cast(info.contents._next, c_void_p).value
        self._new("session", session)
        self._state_is("IDLE")
        self._state_is("READY")

    def xrDestroySession(self, session):
        pass

    def xrBeginSession(self, session, info):
        for state in ("SYNCHRONIZED", "VISIBLE", "FOCUSED"):
            self._state_is(state)

    def xrRequestExitSession(self, session):
        self._state_is("STOPPING")

    def xrEndSession(self, session):
        self._state_is("IDLE")
        self._state_is("EXITING")

    def xrEnumerateReferenceSpaces(self, session, capacity, count, array):
        count[0] = 3
        for k in range(3 if capacity else 0):
            cast(array, POINTER(c_int))[k] = k + 1

    def xrCreateReferenceSpace(self, session, info, space):
        self._new(("reference", int(info.contents._reference_space_type)), space)

    def xrCreateActionSpace(self, session, info, space):
        name = self._of(info.contents.action)
        self._new((name, self._path(info.contents.subaction_path)), space)

    def xrDestroySpace(self, space):
        pass

    def xrLocateSpace(self, space, base, time, location):
        kind, which = self._of(space)
        pose = self.head
        if kind == "grip":
            pose = self.hands[("/user/hand/left", "/user/hand/right").index(which)]
        elif kind == "gaze":
            pose = self.gaze
        location.contents._location_flags = 0 if pose is None else 3
        if pose is not None:
            self._write(location.contents.pose, pose)

    @staticmethod
    def _write(pose, value) -> None:
        (p, q) = value
        pose.position.x, pose.position.y, pose.position.z = p
        pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w = q

    # Actions.

    def xrCreateActionSet(self, instance, info, made):
        self._new("set", made)

    def xrCreateAction(self, actions, info, action):
        self._new(info.contents.action_name.decode(), action)

    def xrSuggestInteractionProfileBindings(self, instance, info):
        given = info.contents
        profile = self._path(given.interaction_profile)
        found = [given._suggested_bindings[k] for k in range(given.count_suggested_bindings)]
        self.bound[profile] = {self._path(b.binding): self._of(b.action) for b in found}

    def xrAttachSessionActionSets(self, session, info):
        pass

    def xrSyncActions(self, session, info):
        pass

    def _value(self, info, state, default) -> Any:
        name, hand = self._of(info.contents.action), self._path(info.contents.subaction_path)
        parts = [p for p, n in self.bound[self.profile].items() if n == name and p.startswith(hand)]
        state.contents.is_active = 1 if parts else 0
        return self.state.get(parts[0], default) if parts else default

    def xrGetActionStateBoolean(self, session, info, state):
        state.contents.current_state = int(self._value(info, state, 0))

    def xrGetActionStateFloat(self, session, info, state):
        state.contents.current_state = float(self._value(info, state, 0.0))

    def xrGetActionStateVector2f(self, session, info, state):
        x, y = self._value(info, state, (0.0, 0.0))
        state.contents.current_state.x, state.contents.current_state.y = x, y

    def xrApplyHapticFeedback(self, session, info, feedback):
        shake = cast(feedback, POINTER(self.xr.HapticVibration)).contents
        hand = self._path(info.contents.subaction_path)
        self.pulses.append((hand, float(shake.amplitude), int(shake.duration) * 1e-9))

    # Frames and pictures.

    def xrWaitFrame(self, session, info, state):
        self.script(self, self.frames)
        self.frames += 1
        self.time += PERIOD
        state.contents.predicted_display_time = self.time
        state.contents.predicted_display_period = PERIOD
        state.contents.should_render = 1

    def xrBeginFrame(self, session, info):
        pass

    def xrEnumerateViewConfigurationViews(self, instance, system, kind, capacity, count, array):
        def fill(entry, size):
            entry.recommended_image_rect_width, entry.recommended_image_rect_height = size

        return self._count([self.size] * 2, capacity, count, array, fill)

    def xrLocateViews(self, session, info, state, capacity, count, array):
        def fill(entry, side):
            (x, y, z), turn = self.head
            self._write(entry.pose, ((x + 0.0315 * side, y, z), turn))
            entry.fov.angle_left, entry.fov.angle_right = -0.8 - 0.1 * side, 0.8 - 0.1 * side
            entry.fov.angle_up, entry.fov.angle_down = 0.8, -0.85

        state.contents._view_state_flags = 3
        return self._count([-1, 1], capacity, count, array, fill)

    def xrEnumerateSwapchainFormats(self, session, capacity, count, array):
        count[0] = 2
        for k, value in enumerate((RGBA, SRGBA) if capacity else ()):
            array[k] = value

    def xrCreateSwapchain(self, session, info, swapchain):
        from OpenGL import GL

        expected = info.contents
        textures = [int(GL.glGenTextures(1)) for _ in range(2)]
        for texture in textures:
            GL.glBindTexture(GL.GL_TEXTURE_2D, texture)
            size = (int(expected.width), int(expected.height))
            GL.glTexImage2D(GL.GL_TEXTURE_2D, 0, int(expected.format), *size, 0, GL.GL_RGBA, GL.GL_UNSIGNED_BYTE, None)
        self._new({"textures": textures, "size": size, "next": 0, "format": int(expected.format)}, swapchain)

    def xrDestroySwapchain(self, swapchain):
        pass

    def xrEnumerateSwapchainImages(self, swapchain, capacity, count, array):
        textures = self._of(swapchain)["textures"]
        count[0] = len(textures)
        images = cast(array, POINTER(self.xr.SwapchainImageOpenGLKHR))
        for k, texture in enumerate(textures if capacity else ()):
            images[k].image = texture

    def xrAcquireSwapchainImage(self, swapchain, info, index):
        chain = self._of(swapchain)
        cast(index, POINTER(c_uint32))[0] = chain["next"]
        chain["acquired"], chain["next"] = chain["next"], 1 - chain["next"]

    def xrWaitSwapchainImage(self, swapchain, info):
        pass

    def xrReleaseSwapchainImage(self, swapchain, info):
        chain = self._of(swapchain)
        chain["shown"] = chain["textures"][chain["acquired"]]

    def xrEndFrame(self, session, info):
        given = info.contents
        if not given.layer_count:
            self.shown.append(None)
            return
        layer = cast(given._layers[0], POINTER(self.xr.CompositionLayerProjection)).contents
        assert layer.view_count == 2
        self.shown.append([self._pixels(layer._views[k].sub_image) for k in range(2)])

    def _pixels(self, image) -> np.ndarray:
        from OpenGL import GL

        chain = self._of(image.swapchain)
        (width, height) = chain["size"]
        GL.glBindTexture(GL.GL_TEXTURE_2D, chain["shown"])
        raw = GL.glGetTexImage(GL.GL_TEXTURE_2D, 0, GL.GL_RGBA, GL.GL_UNSIGNED_BYTE)
        pixels = np.frombuffer(raw, np.uint8).reshape(height, width, 4)[::-1, :, :3]
        at, extent = image.image_rect.offset, image.image_rect.extent
        return pixels[at.y : at.y + extent.height, at.x : at.x + extent.width].copy()


def _guarded(name: str):
    """What the loader calls for a function: that of the runtime that was made last."""

    def called(*arguments):
        try:
            result = getattr(Runtime.current, name)(*arguments)
            return 0 if result is None else int(result)
        except BaseException as e:
            Runtime.current.errors.append(e)
            return -2

    return called


def _get_proc(instance, name, function) -> int:
    found = Runtime.callbacks.get(name.decode())
    function[0] = cast(found, c_void_p).value if found is not None else None
    return 0 if found is not None else -7
