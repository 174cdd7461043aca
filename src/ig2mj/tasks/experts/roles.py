"""Scenes whose objects answer to the names that they have in a task's own home, with its usual models."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

from ig2mj.scene.scene import Scene


@dataclasses.dataclass(frozen=True, eq=False)
class RoleScene(Scene):
    """A scene in which experts find objects by the parts that these play. Attributes: roles: `Task.roles`."""

    roles: Mapping[str, str] = dataclasses.field(default_factory=dict)

    def object_index(self, name: str) -> int:
        """See `Scene.object_index`."""
        return super().object_index(self.roles.get(name, name))


def with_roles(scene: Scene, roles: Mapping[str, str]) -> Scene:
    """The scene, whose objects answer to these names; itself where all have their own."""
    if all(name == here for name, here in roles.items()):
        return scene
    fields = {field.name: getattr(scene, field.name) for field in dataclasses.fields(Scene)}
    return RoleScene(**fields, roles=dict(roles))
