"""What the checks try in a process of its own: `python -m ig2mj.diagnosis.probes NAME` prints one JSON line.

A process of its own, because a broken driver may hang or kill the process that uses it.
"""

from __future__ import annotations

import json
import os
import sys
from typing import Any


def probe_jax() -> dict[str, Any]:
    """Devices that JAX sees, after one addition on each kind."""
    import jax
    import jax.numpy as jnp

    devices = jax.devices()
    for kind in {d.platform: d for d in devices}.values():
        assert int(jax.device_put(jnp.arange(4), kind).sum()) == 6
    return {"devices": [f"{d.platform}:{d.id} {d.device_kind}" for d in devices], "backend": jax.default_backend()}


def probe_warp() -> dict[str, Any]:
    """Devices that Warp sees, after a memory operation on each, and where it keeps compiled kernels."""
    import warp as wp

    from ig2mj.process import prepare_warp
    from ig2mj.process.kernel_cache import kernel_folder

    folder = kernel_folder()
    prepare_warp()
    wp.init()
    for device in wp.get_devices():
        array = wp.zeros(4, dtype=float, device=device)
        array.fill_(1.0)
        assert float(array.numpy().sum()) == 4.0
    return {
        "devices": [f"{d.alias} {d.name}" for d in wp.get_devices()],
        "cuda": [d.name for d in wp.get_cuda_devices()],
        "cache": str(folder),
    }


def probe_mujoco() -> dict[str, Any]:
    """MuJoCo drops a ball on a floor with sleeping on, as every scene of ours has."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(
        '<mujoco><option timestep="0.00833"><flag sleep="enable"/></option><worldbody><geom type="plane" size="1 1 1"/>'
        '<body pos="0 0 .2"><freejoint/><geom size=".1"/></body></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    for _ in range(120):
        mujoco.mj_step(model, data)
    height = float(data.qpos[2])
    assert 0.09 < height < 0.11, f"a ball of radius 0.1 m came to rest at {height} m"
    return {"version": mujoco.mj_versionString()}


PROBES = {"jax": probe_jax, "warp": probe_warp, "mujoco": probe_mujoco}


def main() -> None:
    out = os.dup(1)
    os.dup2(2, 1)  # libraries greet on stdout; only the result may stand there
    line = json.dumps(PROBES[sys.argv[1]]())
    os.write(out, line.encode() + b"\n")


if __name__ == "__main__":
    main()
