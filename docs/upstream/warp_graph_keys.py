"""Warp: a CUDA graph of `jax_callable` is captured again because an array without elements lies elsewhere.

Needs warp-lang, jax with CUDA, and a CUDA device.
"""

import jax
import jax.numpy as jnp
import warp as wp

CALLS = 40
captured: list[tuple[int, int, int]] = []


@wp.kernel
def double(values: wp.array(dtype=float), out: wp.array(dtype=float)):
    out[wp.tid()] = 2.0 * values[wp.tid()]


def act(values: wp.array(dtype=float), nothing: wp.array(dtype=float), out: wp.array(dtype=float)):
    captured.append((values.ptr, nothing.ptr or 0, out.ptr))  # runs once for each graph that is captured
    wp.launch(double, dim=values.size, inputs=[values], outputs=[out])


def main() -> None:
    if not wp.is_cuda_available():
        print("this needs a CUDA device")
        return
    call = wp.jax_callable(act, graph_mode=wp.JaxCallableGraphMode.WARP)

    @jax.jit
    def program(values: jax.Array, nothing: jax.Array) -> jax.Array:
        return call(values, nothing, output_dims=values.size)[0]

    values, kept = jnp.arange(1024.0), []
    for k in range(CALLS):
        program(values, jnp.zeros(0)).block_until_ready()
        kept.append(jnp.zeros(17 * k))  # other work of the process moves what is allocated next
        if k % 3 == 0:
            kept.pop(0)
    needed = len({(first, last) for first, _, last in captured})
    verdict = "right" if len(captured) == needed else "WRONG"
    print(f"{CALLS} calls: {len(captured)} graphs captured; arrays with elements lay in {needed} places:  {verdict}")


if __name__ == "__main__":
    main()
