"""Warp: Python's garbage collector may run while a CUDA graph is captured, and destroy a program of JAX.

Needs warp-lang, jax with CUDA, and a CUDA device.
"""

import gc

import jax
import jax.numpy as jnp
import warp as wp


@wp.kernel
def add_one(values: wp.array(dtype=float)):
    values[wp.tid()] += 1.0


def drop_a_program(array: jax.Array) -> None:
    """Leaves a compiled program in a reference cycle, as an object that holds its own jitted method does."""
    program = jax.jit(lambda x: jnp.sin(x) * 3.0 + x[::-1]).lower(array).compile()
    program(array).block_until_ready()
    cycle: list = [program]
    cycle.append(cycle)


def main() -> None:
    if not wp.is_cuda_available():
        print("this needs a CUDA device")
        return
    array = jnp.arange(1024.0)
    values = wp.zeros(4, dtype=float, device="cuda:0")
    wp.load_module(device="cuda:0")
    gc.collect()
    gc.disable()
    drop_a_program(array)
    jax.clear_caches()
    try:
        with wp.ScopedDevice("cuda:0"), wp.ScopedCapture() as capture:
            gc.collect()  # at any allocation of Python objects while the graph is captured, where it is not disabled
            wp.launch(add_one, dim=4, inputs=[values])
        wp.capture_launch(capture.graph)
        wp.synchronize()
        print("right: the graph works:", values.numpy())
    except Exception as failure:
        print("WRONG: the capture is lost:", failure)


if __name__ == "__main__":
    main()
