"""Warp: `device_from_jax` takes a number among the devices of all processes for one of this process.

Needs warp-lang and a CUDA device; a description of JAX's device stands for the second process of `jax.distributed`.
"""

import types

import warp as wp


def main() -> None:
    wp.init()
    count = wp.get_cuda_device_count()
    if not count:
        print("this needs a CUDA device")
        return
    # Process 1 of two, each with `count` GPUs of its own: its first GPU has the number `count` among all.
    device = types.SimpleNamespace(platform="gpu", id=count, local_hardware_id=0, process_index=1)
    try:
        found = str(wp.device_from_jax(device))
    except Exception as failure:
        found = f"{type(failure).__name__}: {failure}"
    print("found:", found, "  right" if found == "cuda:0" else "  WRONG: cuda:0 is right")


if __name__ == "__main__":
    main()
