"""What a mesh file may be at most, and the error of one that cannot be used."""

from __future__ import annotations

from ig2mj.errors import InputError

MAX_FACES = 1_000_000  # triangles of one file; MuJoCo takes such a mesh, hulls and pictures of it take minutes
MAX_MESH_BYTES = 512 * 2**20


class MeshError(InputError):
    """A geometry, or a mesh file's content, cannot be used: fatal for a collision, a warning for a visual."""


def too_many_faces(file: object, count: int) -> MeshError:
    return MeshError(
        file, f"has {count} or more faces, the limit is {MAX_FACES}", mend="simplify the mesh, for example in Blender"
    )
