"""What OpenXR's controllers are asked for, and which of their parts that is.

Every profile names the parts that it has; what it lacks stays at zero.
"""

from __future__ import annotations

HANDS = ("/user/hand/left", "/user/hand/right")

POSES, FLOATS, STICKS, BUTTONS, HAPTICS = (
    ("grip",),
    ("trigger", "squeeze"),
    ("stick",),
    ("primary", "secondary"),
    ("pulse",),
)
"""Actions by kind. All are there for both hands."""

GAZE = "gaze"
GAZE_PROFILE = "/interaction_profiles/ext/eye_gaze_interaction"
GAZE_PATH = "/user/eyes_ext/input/gaze_ext/pose"

_EVERYWHERE = {"grip": "input/grip/pose", "pulse": "output/haptic"}

PROFILES: dict[str, dict[str, str | tuple[str, str]]] = {
    "/interaction_profiles/khr/simple_controller": {**_EVERYWHERE, "trigger": "input/select/click"},
    "/interaction_profiles/oculus/touch_controller": {
        **_EVERYWHERE,
        "trigger": "input/trigger/value",
        "squeeze": "input/squeeze/value",
        "stick": "input/thumbstick",
        "primary": ("input/x/click", "input/a/click"),
        "secondary": ("input/y/click", "input/b/click"),
    },
    "/interaction_profiles/valve/index_controller": {
        **_EVERYWHERE,
        "trigger": "input/trigger/value",
        "squeeze": "input/squeeze/value",
        "stick": "input/thumbstick",
        "primary": "input/a/click",
        "secondary": "input/b/click",
    },
    "/interaction_profiles/htc/vive_controller": {
        **_EVERYWHERE,
        "trigger": "input/trigger/value",
        "squeeze": "input/squeeze/click",
        "stick": "input/trackpad",
        "secondary": "input/menu/click",
    },
    "/interaction_profiles/microsoft/motion_controller": {
        **_EVERYWHERE,
        "trigger": "input/trigger/value",
        "squeeze": "input/squeeze/click",
        "stick": "input/thumbstick",
        "secondary": "input/menu/click",
    },
}
"""Profile -> action -> its part, or those of the left and of the right hand."""


def part_of(profile: str, action: str, hand: int) -> str | None:
    """Path of an action's part in a profile; None where it has none."""
    part = PROFILES[profile].get(action)
    if part is None:
        return None
    return f"{HANDS[hand]}/{part if isinstance(part, str) else part[hand]}"


PRIMARY_BIT, SECONDARY_BIT = 1 << 4, 1 << 5
"""In `Hand.buttons`: A/X and B/Y of WebXR's "xr-standard" mapping."""
