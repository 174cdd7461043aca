"""How homes look to people and cameras: decoration, light and materials that physics knows nothing of.

    visual = visual_of(scene)                       # looks of the scene: "day", "night" or "plain"
    data = visual.data(model, physics_data)         # poses of a world
    image = ig2mj.viewer.offscreen.render(visual.model, data, "kitchen_0")

`visual.model` is the scene's model with geoms, materials, textures and lights added behind its own, so that every id of
the scene keeps its meaning. The scene's own model, its hash, and everything bound to them stay as they are.
"""

from ig2mj.looks.visual import Visual, visual_of

__all__ = ["Visual", "visual_of"]
