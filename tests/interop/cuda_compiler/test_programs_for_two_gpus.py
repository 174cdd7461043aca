"""XLA compiles programs for GPUs that this machine does not have: those over two devices, on which it once ended.

A crash of the compiler takes the process with it, so each is compiled in a process of its own. Nothing is run.
"""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

BEGIN = """
import jax, jax.numpy as jnp, numpy as np
from jax.experimental import topologies
from jax.sharding import Mesh, NamedSharding, PartitionSpec as P

TARGET = '''
platform_name: "CUDA"
device_description_str: "NVIDIA H200"
dnn_version_info { major: 9 minor: 12 }
runtime_version { major: 13 }
gpu_device_info {
  driver_version: "13.0.0" runtime_version: "13.0.0" compile_time_toolkit_version: "13.0.0"
  cuda_compute_capability { major: 9 minor: 0 }
  threads_per_block_limit: 1024 threads_per_warp: 32 threads_per_core_limit: 2048
  shared_memory_per_block: 49152 shared_memory_per_core: 233472 shared_memory_per_block_optin: 232448
  registers_per_core_limit: 65536 registers_per_block_limit: 65536
  core_count: 132 fpus_per_core: 128 clock_rate_ghz: 1.98 l2_cache_size: 62914560
  block_dim_limit_x: 2147483647 block_dim_limit_y: 65535 block_dim_limit_z: 65535
  memory_bandwidth: 4800000000000 device_memory_size: 150754820096
}
'''
topology = topologies.get_topology_desc("h200", platform="cuda", topology="1x1x2", target_config=TARGET)
devices = list(topology.devices)

def placed(tree, spec, mesh):
    return jax.tree.map(lambda a: jax.ShapeDtypeStruct(a.shape, a.dtype, sharding=NamedSharding(mesh, spec)), tree)
"""

LEARNER = """
import dataclasses
from ig2mj.learn.collect import Seen, Transition
from ig2mj.learn.several_devices import AXIS, ManyDevices
from ig2mj.learn.perception import Perception
from ig2mj.learn.sac import SAC, SACConfig
from ig2mj.learn.nonempty_leaves import nonempty, nonempty_specs

@dataclasses.dataclass
class Space:
    shape: tuple
    dtype: type = np.float32

class Env:
    pure, num_worlds = True, 32
    def prepare_devices(self, devices): pass

vectors = {"proprioception": Space((8,)), "privileged_state": Space((5,))}
pictures = {"rgb": Space((64, 64, 3), np.uint8), "depth": Space((64, 64, 1))} if MODE == "rgbd" else {}
config = SACConfig(utd_ratio=4, batch_size=64, buffer_size=4000, actor_layers=(32,), critic_layers=(32,), num_atoms=21)
sac = SAC(Perception({**vectors, **pictures}, MODE), 2, config, AXIS)
many = ManyDevices(Env(), sac, devices)
memory, learner = jax.eval_shape(lambda: sac.buffer(64)), jax.eval_shape(lambda: sac.init(jax.random.PRNGKey(0)))
shape = lambda *s, dtype=jnp.float32: jax.ShapeDtypeStruct((sac.length, 64, *s), dtype)
pixels = 0 if sac.perception.image_shape is None else int(np.prod(sac.perception.image_shape))
seen = Seen(shape(sac.perception.vector_size), shape(pixels, dtype=jnp.uint8))
over = shape(dtype=jnp.bool_)
rollout = Transition(seen, shape(2), {}, shape(), over, over, seen)
sums = {"episodes": jax.ShapeDtypeStruct((2,), jnp.float32)}
mesh, whole, each = many._mesh, P(), P(AXIS)
program = many._program(learner, memory, rollout, sums)
leaves = []
for tree, specs in ((learner, whole), (memory, many._buffer_specs), (rollout, P(None, AXIS)), (sums, each)):
    leaves.append([placed(a, spec, mesh) for a, spec in zip(nonempty(tree), nonempty_specs(tree, specs))])
rest = [placed(jax.ShapeDtypeStruct(s, t), spec, mesh) for s, t, spec in
        (((2, 2), jnp.float32, each), ((2,), jnp.uint32, whole), ((), jnp.bool_, whole))]
program.lower(*leaves, *rest).compile()
print("COMPILED")
"""

EMPTY = """
mesh = Mesh(np.array(devices), ("d",))
def both(a, empty):
    return jax.lax.psum(a, "d"), empty + 1

mapped = jax.shard_map(both, mesh=mesh, in_specs=(P("d"), P("d")), out_specs=(P(), P("d")), check_vma=False)
program = jax.jit(mapped)
program.lower(placed(jnp.zeros((2, 3)), P("d"), mesh), placed(jnp.zeros((2, 0)), P("d"), mesh)).compile()
print("COMPILED")
"""


def compiled(code: str) -> bool:
    # The plug-in asks for CUDA's libraries, which only running needs.
    environment = {**os.environ, "JAX_PLATFORMS": "cpu", "JAX_SKIP_CUDA_CONSTRAINTS_CHECK": "1"}
    command = [sys.executable, "-c", BEGIN + code]
    done = subprocess.run(command, capture_output=True, text=True, timeout=800, env=environment)
    assert done.returncode <= 0, done.stderr[-3000:]  # below: ended by a signal
    return "COMPILED" in done.stdout


@pytest.mark.timeout(900)
@pytest.mark.parametrize("mode", ["state", "rgbd"])
def test_learning_on_two_gpus_compiles(mode):
    assert compiled(f"MODE = {mode!r}" + LEARNER)


def test_an_array_without_elements_is_still_too_much_for_the_compiler():
    """When this fails, XLA is repaired, and `ig2mj.learn.nonempty_leaves` is needed no longer."""
    assert not compiled(EMPTY)
