"""MuJoCo's geom groups, as converted homes and robots use them: groups 0 to 2 are visual, group 3 collides."""

from __future__ import annotations

VISIBLE_GROUPS = (0, 1, 2)
"""Groups that images and sensors show unless asked otherwise, as in MuJoCo's viewer."""

COLLISION_GROUP = 3
"""What collides and is drawn by other geoms, or not at all."""

HIDDEN_GROUP = 5
"""MuJoCo's last group, for geoms that are not to be drawn just now."""
