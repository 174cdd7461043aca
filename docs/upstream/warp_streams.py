"""Warp: the first of two wrappers of one external CUDA stream that goes away takes the stream from the other.

Needs warp-lang and a CUDA device.
"""

import warp as wp


@wp.kernel
def add_one(values: wp.array(dtype=float)):
    values[wp.tid()] += 1.0


def main() -> None:
    wp.init()
    if not wp.is_cuda_available():
        print("this needs a CUDA device")
        return
    device = wp.get_cuda_device()
    external = wp.Stream(device)  # stands for a stream of JAX, which Warp wraps once for each call
    values = wp.zeros(4, dtype=float, device=device)
    wp.load_module(device=device)
    first = wp.Stream(device, cuda_stream=external.cuda_stream)
    second = wp.Stream(device, cuda_stream=external.cuda_stream)
    del first
    try:
        with wp.ScopedStream(second), wp.ScopedCapture(stream=second) as capture:
            wp.launch(add_one, dim=4, inputs=[values], device=device)
        wp.capture_launch(capture.graph)
        wp.synchronize()
        print("right: the second wrapper works after the first was destroyed:", values.numpy())
    except Exception as failure:
        print("WRONG: the second wrapper fails after the first was destroyed:", failure)


if __name__ == "__main__":
    main()
