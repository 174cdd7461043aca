"""Convolutions of 3x3 pixels that are quick on processors, too.

XLA's convolutions for processors are quick in a program's outermost part only: in a loop, where all updates are, the
same gradients take 50 times as long. There a convolution is nine shifted images next to each other and one product of
matrices. For GPUs it stays XLA's own. A program has those of what it is compiled for, whatever compiles it.

Axes: B samples, h and w rows and columns of the input, p and q of the output, c and f channels of input and output.
"""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
from jax import Array
from jaxtyping import Float

SIDE = 3
"""Rows and columns of a kernel."""


def convolve(inputs: Array, kernel: Array, strides: Any, padding: Any, **options: Any) -> Array:
    """For `flax.linen.Conv(..., conv_general_dilated=convolve)`: kernels of 3x3, one stride, padding "SAME"."""
    (stride, across), (rows, columns, _, _) = strides, kernel.shape
    assert padding == "SAME" and stride == across and rows == columns == SIDE, "no other convolution is needed yet"
    return _convolved(inputs, kernel, stride)


def by_xla(inputs: Float[Array, "B h w c"], kernel: Float[Array, "3 3 c f"], stride: int) -> Float[Array, "B p q f"]:
    """XLA's own convolution."""
    order = ("NHWC", "HWIO", "NHWC")
    return jax.lax.conv_general_dilated(inputs, kernel, (stride, stride), "SAME", dimension_numbers=order)


def by_product(
    inputs: Float[Array, "B h w c"], kernel: Float[Array, "3 3 c f"], stride: int
) -> Float[Array, "B p q f"]:
    """The same as shifted images and a product of matrices."""
    pads, spans = [], []
    for size in inputs.shape[1:3]:
        last = (-(-size // stride) - 1) * stride
        missing = max(last + SIDE - size, 0)
        pads.append((missing // 2, missing - missing // 2))
        spans.append(last + 1)
    padded = jnp.pad(inputs, ((0, 0), *pads, (0, 0)))
    shifts = [(i, j) for i in range(SIDE) for j in range(SIDE)]
    near = [padded[:, i : i + spans[0] : stride, j : j + spans[1] : stride] for i, j in shifts]
    return jnp.concatenate(near, axis=-1) @ kernel.reshape(-1, kernel.shape[-1])


def _forward(inputs: Array, kernel: Array, stride: int) -> tuple[Array, tuple[Array, Array]]:
    done = jax.lax.platform_dependent(
        inputs, kernel, cpu=lambda x, k: by_product(x, k, stride), default=lambda x, k: by_xla(x, k, stride)
    )
    return done, (inputs, kernel)


def _backward(stride: int, kept: tuple[Array, Array], slope: Array) -> tuple[Array, Array]:
    def of(convolution: Any) -> Any:
        return lambda x, k, slope: jax.vjp(lambda x, k: convolution(x, k, stride), x, k)[1](slope)

    return jax.lax.platform_dependent(*kept, slope, cpu=of(by_product), default=of(by_xla))


# differentiated by itself, so that a program for one platform keeps nothing for the other's gradients
_convolved = jax.custom_vjp(lambda inputs, kernel, stride: _forward(inputs, kernel, stride)[0], nondiff_argnums=(2,))
_convolved.defvjp(_forward, _backward)
