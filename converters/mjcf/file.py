"""Writing `scene.xml` and reading it back as a user's MuJoCo will."""

from __future__ import annotations

import pathlib

import mujoco

from ig2mj.errors import InputError, without_lines


def write_model(spec: mujoco.MjSpec, file: pathlib.Path) -> mujoco.MjModel:
    """Compiles the model, writes it, and returns what MuJoCo loads from the written file.

    Raises:
      InputError: MuJoCo refuses the model.
    """
    try:
        spec.compile()
        file.write_text(spec.to_xml(), encoding="utf-8")
        return mujoco.MjModel.from_xml_path(str(file))
    except (ValueError, mujoco.FatalError) as e:
        raise InputError(spec.modelname, f"does not compile: {without_lines(e)}") from e
