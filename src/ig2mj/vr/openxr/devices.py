"""`Headset`: an OpenXR session: its frames, its devices' poses, pulses, and images for both eyes.

    with Headset(graphics=None) as headset:           # without pictures: XR_MND_headless
        while headset.running:
            frame = headset.wait()                    # None while the runtime wants none
            poses, eyes = headset.locate(frame)
            headset.end(frame)

One thread uses it. Pulses may be asked for from any other; they are sent with the next frame.
"""

from __future__ import annotations

import contextlib
import ctypes
import dataclasses
import queue
import time
from typing import Any, Protocol, runtime_checkable

import numpy as np

from ig2mj.errors import EngineError, MissingDependencyError
from ig2mj.install_hint import pip_install_extra
from ig2mj.process.settings import name_opengl_platform
from ig2mj.vr.frames import Gaze, Hand, PoseFrame
from ig2mj.vr.openxr import actions
from ig2mj.vr.stereo import Eye
from ig2mj.vr.xr_axes import hand_from_grip, head_from_xr

HEADLESS, GAZE = "XR_MND_headless", "XR_EXT_eye_gaze_interaction"

Row = tuple[tuple[float, float, float], tuple[float, float, float, float]]


@runtime_checkable
class Graphics(Protocol):
    """Who draws. `extension`: the runtime must offer it."""

    extension: str

    def check(self, instance: Any, system: Any) -> None:
        """What must be asked of the runtime before a session."""
        ...

    def binding(self) -> Any:
        """Of OpenGL, for `xr.SessionCreateInfo.next`."""
        ...

    def begin(self, session: Any, sizes: list[tuple[int, int]]) -> None:
        """Creates the swapchains of the images."""
        ...

    def layers(self, space: Any, views: Any) -> list[Any]:
        """Submits the rendered images of these views."""
        ...

    def close(self) -> None: ...


@dataclasses.dataclass(frozen=True)
class DeviceFrame:
    """Of the runtime. `time`: ns, when it will be seen. `draw`: images are needed."""

    time: int
    draw: bool


def load_xr() -> Any:
    """The module `xr`. Raises MissingDependencyError: pyopenxr is not installed.

    On Linux it makes PyOpenGL one of GLX, with which MuJoCo can no longer draw by EGL; that is undone.
    """
    try:
        name_opengl_platform()
        import OpenGL.EGL  # both before xr, so that they are made for this platform
        import OpenGL.GL
        import OpenGL.platform

        before = OpenGL.platform.PLATFORM
        import xr

        OpenGL.platform.PLATFORM = before
    except (ImportError, AttributeError, OSError) as e:
        raise MissingDependencyError(f"pyopenxr does not load: {e} ({pip_install_extra('xr')})") from e
    return xr


class Headset:
    """See the module's text. Attributes: gazes: eyes are tracked. system: name of the device."""

    def __init__(self, graphics: Graphics | None = None):
        """Opens a session.

        Raises:
          MissingDependencyError: pyopenxr or a runtime is missing. EngineError: the runtime has no headset, or cannot
            do what is needed.
        """
        self._xr = xr = load_xr()
        self._graphics, self._pulses = graphics, queue.SimpleQueue[tuple[int, float, float]]()
        self.running, self._closed, self._begun, self._time = True, False, False, 0
        self._session: Any = None
        needed = HEADLESS if graphics is None else graphics.extension
        try:
            offered = {p.extension_name.decode() for p in xr.enumerate_instance_extension_properties()}
        except xr.exception.XrException as e:
            raise MissingDependencyError(f"no OpenXR runtime is active here ({_text(e)})") from e
        if needed not in offered:
            raise EngineError(f"the OpenXR runtime lacks {needed}; it offers {', '.join(sorted(offered)) or 'nothing'}")
        self.gazes = GAZE in offered
        requested = [needed, *([GAZE] if self.gazes else [])]
        about = xr.ApplicationInfo("ig2mj", 1, "ig2mj", 1, xr.Version(1, 0, 0))
        try:
            self._instance = xr.create_instance(
                xr.InstanceCreateInfo(application_info=about, enabled_extension_names=requested)
            )
            self._open(graphics)
        except xr.exception.XrException as e:
            raise EngineError(f"the OpenXR runtime refuses: {_text(e)}") from e

    def _open(self, graphics: Graphics | None) -> None:
        xr = self._xr
        self._system = xr.get_system(self._instance, xr.SystemGetInfo(xr.FormFactor.HEAD_MOUNTED_DISPLAY))
        self.system = xr.get_system_properties(self._instance, self._system).system_name.decode()
        if graphics is not None:
            graphics.check(self._instance, self._system)
        binding = None if graphics is None else ctypes.cast(ctypes.pointer(graphics.binding()), ctypes.c_void_p)
        self._session = xr.create_session(self._instance, xr.SessionCreateInfo(system_id=self._system, next=binding))
        unit = xr.Posef()
        spaces = xr.enumerate_reference_spaces(self._session)
        floor = int(xr.ReferenceSpaceType.STAGE) in [int(s) for s in spaces]
        kind = xr.ReferenceSpaceType.STAGE if floor else xr.ReferenceSpaceType.LOCAL
        self._lift = 0.0 if floor else 1.6  # a seated space begins at the eyes
        self._space = xr.create_reference_space(self._session, xr.ReferenceSpaceCreateInfo(kind, unit))
        view = xr.ReferenceSpaceCreateInfo(xr.ReferenceSpaceType.VIEW, unit)
        self._view = xr.create_reference_space(self._session, view)
        self._make_actions()
        if graphics is not None:
            stereo = xr.ViewConfigurationType.PRIMARY_STEREO
            views = xr.enumerate_view_configuration_views(self._instance, self._system, stereo)
            sizes = [(v.recommended_image_rect_width, v.recommended_image_rect_height) for v in views]
            graphics.begin(self._session, sizes)

    def _make_actions(self) -> None:
        xr = self._xr
        self._hands = [xr.string_to_path(self._instance, hand) for hand in actions.HANDS]
        self._set = xr.create_action_set(self._instance, xr.ActionSetCreateInfo("person", "A person in a home"))
        kinds = {
            xr.ActionType.POSE_INPUT: actions.POSES,
            xr.ActionType.FLOAT_INPUT: actions.FLOATS,
            xr.ActionType.VECTOR2F_INPUT: actions.STICKS,
            xr.ActionType.BOOLEAN_INPUT: actions.BUTTONS,
            xr.ActionType.VIBRATION_OUTPUT: actions.HAPTICS,
        }
        self._actions: dict[str, Any] = {}
        both = (ctypes.c_uint64 * 2)(*[int(path) if isinstance(path, int) else path.value for path in self._hands])
        for kind, names in kinds.items():
            for name in names:
                info = xr.ActionCreateInfo(name, kind, 2, both, name)
                self._actions[name] = xr.create_action(self._set, info)
        for profile in actions.PROFILES:
            bound = [
                (self._actions[name], part)
                for name in self._actions
                for hand in range(2)
                if (part := actions.part_of(profile, name, hand)) is not None
            ]
            self._suggest(profile, bound)
        if self.gazes:
            info = xr.ActionCreateInfo(actions.GAZE, xr.ActionType.POSE_INPUT, 0, None, actions.GAZE)
            self._actions[actions.GAZE] = xr.create_action(self._set, info)
            self._suggest(actions.GAZE_PROFILE, [(self._actions[actions.GAZE], actions.GAZE_PATH)])
        sets = (xr.ActionSet * 1)(self._set)
        xr.attach_session_action_sets(self._session, xr.SessionActionSetsAttachInfo(1, sets))
        self._grips = [
            xr.create_action_space(self._session, xr.ActionSpaceCreateInfo(self._actions["grip"], hand, xr.Posef()))
            for hand in self._hands
        ]
        self._gaze = None
        if self.gazes:
            info = xr.ActionSpaceCreateInfo(self._actions[actions.GAZE], 0, xr.Posef())
            self._gaze = xr.create_action_space(self._session, info)

    def _suggest(self, profile: str, bound: list[tuple[Any, str]]) -> None:
        """Tells the runtime which parts of a kind of controller are meant; one that it does not know is left out."""
        xr = self._xr
        bindings = (xr.ActionSuggestedBinding * len(bound))(
            *[xr.ActionSuggestedBinding(action, xr.string_to_path(self._instance, path)) for action, path in bound]
        )
        path = xr.string_to_path(self._instance, profile)
        with contextlib.suppress(xr.exception.PathUnsupportedError):
            xr.suggest_interaction_profile_bindings(
                self._instance, xr.InteractionProfileSuggestedBinding(path, len(bound), bindings)
            )

    # Frames.

    def wait(self) -> DeviceFrame | None:
        """Waits for the runtime's next frame and begins it; None while the session does not run."""
        xr = self._xr
        self._events()
        if not self._begun:
            time.sleep(0.01)
            return None
        state = xr.wait_frame(self._session)
        xr.begin_frame(self._session)
        self._time = int(state.predicted_display_time)
        return DeviceFrame(self._time, bool(state.should_render) and self._graphics is not None)

    def locate(self, frame: DeviceFrame) -> tuple[PoseFrame, tuple[Eye, Eye] | None]:
        """Devices and eyes at the time at which a frame will be seen, in the play area."""
        xr = self._xr
        active = (xr.ActiveActionSet * 1)(xr.ActiveActionSet(self._set, 0))
        with contextlib.suppress(xr.exception.SessionNotFocused):
            xr.sync_actions(self._session, xr.ActionsSyncInfo(1, active))
        head = self._pose_of(self._view, frame.time)
        hands = tuple(self._hand(k, frame.time) for k in range(2))
        found = PoseFrame(
            frame.time * 1e-9,
            None if head is None else head_from_xr(*head),
            (hands[0], hands[1]),
            gaze=self._gaze_at(frame.time),
        )
        self._views = None
        if not frame.draw:
            return found, None
        info = xr.ViewLocateInfo(xr.ViewConfigurationType.PRIMARY_STEREO, frame.time, self._space)
        _, self._views = xr.locate_views(self._session, info)
        return found, (self._eye(self._views[0]), self._eye(self._views[1]))

    def end(self, frame: DeviceFrame, drawn: bool = False) -> None:
        """Hands a frame over. `drawn`: images of the views located last belong to it."""
        xr = self._xr
        layers = []
        if drawn and self._graphics is not None and self._views is not None:
            layers = self._graphics.layers(self._space, self._views)
        self._send_pulses()
        info = xr.FrameEndInfo(frame.time, xr.EnvironmentBlendMode.OPAQUE, layers=layers)
        xr.end_frame(self._session, info)

    def pulse(self, hand: int, strength: float, seconds: float) -> None:
        """Lets a hand's controller vibrate. From any thread."""
        self._pulses.put((hand, strength, seconds))

    def ask_to_end(self) -> None:
        """Asks the runtime to end the session; `running` becomes False when it does."""
        if self._begun:
            self._xr.request_exit_session(self._session)
        else:
            self.running = False

    def close(self) -> None:
        """Ends everything; may be called twice."""
        if self._closed:
            return
        self._closed = True
        self.running = False
        if self._graphics is not None:
            self._graphics.close()
        if self._session is not None:
            self._xr.destroy_session(self._session)
        self._xr.destroy_instance(self._instance)

    def __enter__(self) -> Headset:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _events(self) -> None:
        """Follows the states of the session."""
        xr = self._xr
        while True:
            try:
                event = xr.poll_event(self._instance)
            except xr.exception.EventUnavailable:
                return
            kind = xr.StructureType(event.type)
            if kind == xr.StructureType.EVENT_DATA_INSTANCE_LOSS_PENDING:
                self.running = self._begun = False
            if kind != xr.StructureType.EVENT_DATA_SESSION_STATE_CHANGED:
                continue
            changed = ctypes.cast(ctypes.byref(event), ctypes.POINTER(xr.EventDataSessionStateChanged)).contents
            state = xr.SessionState(changed.state)
            if state == xr.SessionState.READY:
                xr.begin_session(self._session, xr.SessionBeginInfo(xr.ViewConfigurationType.PRIMARY_STEREO))
                self._begun = True
            elif state == xr.SessionState.STOPPING:
                self._begun = False
                xr.end_session(self._session)
            elif state in (xr.SessionState.EXITING, xr.SessionState.LOSS_PENDING):
                self.running = self._begun = False

    def _hand(self, k: int, when: int) -> Hand:
        grip = self._pose_of(self._grips[k], when)
        buttons = 0
        for name, bit in (("primary", actions.PRIMARY_BIT), ("secondary", actions.SECONDARY_BIT)):
            if self._state("boolean", name, k):
                buttons |= bit
        stick = self._state("vector2f", "stick", k)
        return Hand(
            None if grip is None else hand_from_grip(k, *grip),
            float(np.clip(self._state("float", "trigger", k) or 0.0, 0.0, 1.0)),
            float(np.clip(self._state("float", "squeeze", k) or 0.0, 0.0, 1.0)),
            (0.0, 0.0) if stick is None else (float(stick.x), float(stick.y)),
            buttons,
        )

    def _state(self, kind: str, name: str, hand: int) -> Any:
        """Of an action of a hand; None where no controller has it."""
        info = self._xr.ActionStateGetInfo(self._actions[name], self._hands[hand])
        state = getattr(self._xr, f"get_action_state_{kind}")(self._session, info)
        return state.current_state if state.is_active else None

    def _gaze_at(self, when: int) -> Gaze | None:
        found = None if self._gaze is None else self._pose_of(self._gaze, when)
        if found is None:
            return None
        eye = head_from_xr(*found)
        return Gaze(eye.pos, eye.turn.apply((1.0, 0.0, 0.0)))

    def _pose_of(self, space: Any, when: int) -> Row | None:
        xr = self._xr
        found = xr.locate_space(space, self._space, when)
        both = xr.SpaceLocationFlags.POSITION_VALID_BIT | xr.SpaceLocationFlags.ORIENTATION_VALID_BIT
        return self._row(found.pose) if (int(found.location_flags) & int(both)) == int(both) else None

    def _row(self, pose: Any) -> Row:
        p, q = pose.position, pose.orientation
        return (p.x, p.y + self._lift, p.z), (q.x, q.y, q.z, q.w)

    def _eye(self, view: Any) -> Eye:
        fov = view.fov
        return Eye(head_from_xr(*self._row(view.pose)), fov.angle_left, fov.angle_right, fov.angle_up, fov.angle_down)

    def _send_pulses(self) -> None:
        xr = self._xr
        while not self._pulses.empty():
            hand, strength, seconds = self._pulses.get()
            shake = xr.HapticVibration(duration=int(seconds * 1e9), frequency=0.0, amplitude=strength)
            info = xr.HapticActionInfo(self._actions["pulse"], self._hands[hand])
            xr.apply_haptic_feedback(self._session, info, shake)


def _text(error: Exception) -> str:
    return f"{type(error).__name__}: {' '.join(str(error).split())}"
