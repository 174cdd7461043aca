"""What `ig2mj.engine.warp.patches` was written for: a version of MuJoCo Warp and the source of each function it needs.

For another version, hold each function of ours against the new original, run `make test-slow` and, on a machine with a
GPU, `make test-gpu`, and then put into this file what `renewed()` gives.
"""

from __future__ import annotations

import functools
import hashlib
import importlib
import importlib.metadata
import inspect
from typing import Any

PACKAGE, VERSION = "mujoco-mjx", "3.17.0"
"""The package that MuJoCo Warp comes in; the one version that will do."""

PINS: dict[str, dict[str, str]] = {
    "third_party.mujoco_warp._src.solver": {
        "_cholesky_factorize_solve": "5f04c3acf13da87e",
        "_update_gradient_init_h_sparse": "714103269c06d40b",
        "smooth_solve_compact": "5c766f3a108dfa8a",
        "_solve_init_dof": "e4181ee9d37d22f6",
        "_upper_triangle_index": "d941a69ae11a33c0",
        "_sparse_compact": "dd3b0edb4f2fe6ed",
        "_BLOCK_CHOLESKY_DIM": "e29c9c180c6279b0",
        "_gather_M_sparse": "dc97ec78fd583862",
        "_gather_rhs_compact": "e942f05b3d418b5c",
        "_scatter_solution": "83b0d57b4efb77a3",
    },
    "third_party.mujoco_warp._src.block_cholesky": {
        "create_blocked_cholesky_factorize_solve_func": "658be72302f015fc",
        "create_blocked_cholesky_augmented_factorize_solve_newton_func": "82b0b865fef4f099",
        "create_blocked_cholesky_solve_newton_func": "4537e585510babb9",
    },
    "third_party.mujoco_warp._src.passive": {
        "passive": "ef642c49ab9005d5",
    },
    "third_party.mujoco_warp._src.collision_driver": {
        "collision": "3d1c73121265b969",
        "nxn_broadphase": "e0bc5054607af27e",
        "sap_broadphase": "f725ef0e53294dbe",
        "_broadphase_filter": "41a3e719defc2bbb",
        "_mesh_missing": "ba0b184b9e6feeb6",
        "_add_geom_pair": "a263137856fb448b",
    },
    "third_party.mujoco_warp._src.sleep": {
        "sleep": "26f96a277dece2bd",
        "_sweep_awake_trees": "0579b7a7f89dbd56",
        "_check_island_can_sleep": "0a4c452212d2ec59",
        "_build_cycles": "d9907205cea19db8",
    },
    "third_party.mujoco_warp._src.forward": {
        "_advance": "54efaa99438929bd",
        "fwd_velocity": "28c856716bb4645a",
    },
    "third_party.mujoco_warp._src.support": {
        "jac_dof": "8f48a613029a60fb",
    },
    "third_party.mujoco_warp._src.math": {
        "upper_tri_index": "8ca898f451fd1a2b",
    },
    "warp.ffi": {
        "jax_callable_variadic_tuple": "5e767a45cafcf17b",
    },
}
"""Of each function replaced or called, by module of MJX and name: the beginning of the SHA-256 of its source."""


@functools.cache
def mismatches() -> tuple[str, ...]:
    """What is not as it was when our functions were written; empty: they fit. Looked up once per process."""
    version = importlib.metadata.version(PACKAGE)
    if version != VERSION:
        return (f"{PACKAGE} {version} is not {VERSION}",)
    return tuple(
        f"{module}.{name} has changed"
        for module, pins in PINS.items()
        for name, pin in pins.items()
        if fingerprint(module, name) != pin
    )


def fingerprint(module: str, name: str) -> str:
    """The beginning of the SHA-256 of a function's source, or of a constant's value; "missing" where there is none."""
    try:
        found: Any = getattr(importlib.import_module(f"mujoco.mjx.{module}"), name)
    except (ImportError, AttributeError):
        return "missing"
    found = getattr(found, "func", found)  # of Warp's kernels and functions
    text = inspect.getsource(inspect.unwrap(found)) if callable(found) else repr(found)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def renewed() -> str:
    """The lines of this file for what is installed."""
    lines = [f'PACKAGE, VERSION = "{PACKAGE}", "{importlib.metadata.version(PACKAGE)}"']
    for module, pins in PINS.items():
        lines += [
            f'    "{module}": {{',
            *(f'        "{name}": "{fingerprint(module, name)}",' for name in pins),
            "    },",
        ]
    return "\n".join(lines)
