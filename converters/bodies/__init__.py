"""Bodies, joints, masses and placements of objects, before any MJCF."""
