"""What `ig2mj.engine.warp.patches` was written for: a version of MuJoCo Warp and the source of each function it needs.

For another version: `mismatches()` lists what changed. Compare each function of ours with the new original, run `make
test-slow` and, on a machine with a GPU, `make test-gpu`, both with `IG2MJ_TRY_KERNELS=1` in the environment, which lets
our functions run in spite of these pins. Then put into this file what `renewed()` gives. `docs/notes/upgrade.md` has
the recipe and its last dry run.
"""

from __future__ import annotations

import functools
import hashlib
import importlib
import importlib.metadata
import inspect
import linecache
import os
from typing import Any

PACKAGE, VERSION = "mujoco-mjx", "3.17.0"
"""The package that MuJoCo Warp comes in; the one version that will do."""

TRY, MISSING = "IG2MJ_TRY_KERNELS", "missing"

PINS: dict[str, dict[str, str]] = {
    "third_party.mujoco_warp._src.solver": {
        "solve": "912386ccde41ccd7",
        "_solve": "ccdbc0e66f703d1c",
        "_solver_iteration": "d7062671c414eb9c",
        "_create_solver_context": "79d0760bc3f2fe06",
        "init_context": "dd8f406f00bd996b",
        "_update_gradient": "dc342da2030c9cde",
        "_eval_constraint": "6f74956ad4956605",
        "_qfrc_constraint_from_grad": "b0ce829e007d87e1",
        "_linesearch": "2c8ccfa289768a29",
        "_linesearch_iterative": "84e29462d6195f88",
        "_linesearch_iterative_kernel": "cd59f69f7002a603",
        "_update_constraint": "c9af4896eafd7092",
        "_update_gradient_incremental": "c36fa627cbf81519",
        "_update_gradient_zero_grad_dot": "501b70a04bd1dddf",
        "_update_gradient_grad": "8f7c3d23eeae025c",
        "_update_gradient_h_incremental_sparse": "f3b8e21edc12e6df",
        "_mul_m_compact_aware": "0c6e985ecad44e07",
        "_mul_m_sparse_compact": "4db8d11b9cf2ad52",
        "_zero_change_counters": "23e1ddbcf29ddf50",
        "_zero_qfrc_constraint_sparse": "79d3bab50e703211",
        "_solve_done": "28407ff0781ea32b",
        "_use_incremental": "27435722c48c3f75",
        "solve_compact": "3887036be85651f9",
        "_update_constraint_efc": "79e7db8aa6997aa0",
        "_update_constraint_init_qfrc_constraint_sparse": "449bef4651746db1",
        "_linesearch_jv_fused_kernel": "40771bb5985fb651",
        "_solve_init_jaref_kernel": "dd1bd58e3023cbc3",
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
        "convex_narrowphase": "52e00b5313fab852",
        "_narrowphase": "ee2ccd9e09b5570d",
    },
    "third_party.mujoco_warp._src.collision_convex": {
        "_ccd_grid_size": "191227d2691d2579",
        "ccd_kernel_builder": "3d5061b6135d0c7a",
        "convex_narrowphase": "52e00b5313fab852",
    },
    "third_party.mujoco_warp._src.collision_gjk": {
        "gjk_phase": "1d4477bf48d73562",
        "epa_phase": "4a1ffa446d922127",
        "multicontact": "9587990e6dd180da",
        "GJKResult": "0fd27848aa56cadc",
    },
    "third_party.mujoco_warp._src.smooth": {
        "_kinematics_branch": "5b28e5cd964b5d31",
        "_compute_body_matrices": "3a460da12dbd1764",
        "_compute_body_inertial_frames": "7054fa0c92bd7f08",
        "_geom_local_to_global": "2f833c3ccf4e3591",
        "_site_local_to_global": "6be992ff1c6915b3",
        "_subtree_com_init": "64973848440bc549",
        "_subtree_com_acc": "62d24f65a5052ea5",
        "_subtree_div": "93205ad8a6d021da",
        "_cinert": "0347900cd9ce7c3c",
        "_cdof": "81777902415264eb",
        "_crb_accumulate": "16f51537d74d85da",
        "_M": "9073f9a7b326a0a1",
        "_comvel_branch": "38c15487e05b0b52",
        "_cacc_branch": "25b23f14137b8013",
        "_cfrc": "d574490115cc0020",
        "_cfrc_backward": "3bba5b470a74abc4",
        "_qfrc_bias": "5ef7ee246a3e7f6e",
        "crb": "5e42220d87629392",
        "factor_solve_i": "eae9949855873e71",
        "_small_cholesky_factorize_solve_block": "7ebead016b70722c",
        "kinematics": "3a58e70bfc349e7f",
        "com_pos": "59bce6775783f60f",
        "com_vel": "5577a22d3dfd5a4a",
        "rne": "f902eaf6cb1cdd17",
    },
    "third_party.mujoco_warp._src.island": {
        "compute_island_mapping": "fe5e841f8006d45b",
        "update_active_dofs": "d205427d16fd9850",
        "island": "4541f2df6693e8e7",
    },
    "third_party.mujoco_warp._src.sleep": {
        "wake": "23ae1cd60ab11d16",
        "_wake_kernel": "d5fd98cce5c3a3ad",
        "_wake_collision_kernel": "3a3fb9411d7a4a12",
        "update_sleep": "63f06bdbb907312f",
        "_zero_sleep_counters": "d43cc11caa5d541b",
        "_update_sleep_trees": "62ffea9adf5ebd15",
        "_update_sleep_bodies": "abf452cf620075d7",
        "_update_sleep_dofs": "601fe144e3989821",
        "sleep": "26f96a277dece2bd",
        "_sweep_awake_trees": "0579b7a7f89dbd56",
        "_check_island_can_sleep": "0a4c452212d2ec59",
        "_build_cycles": "d9907205cea19db8",
    },
    "third_party.mujoco_warp._src.forward": {
        "fwd_acceleration": "6804a319165bbf7d",
        "_advance": "54efaa99438929bd",
        "fwd_velocity": "28c856716bb4645a",
        "forward": "24421d5832eceeca",
        "step": "24131cb3192208e6",
        "implicit": "d800f8e759f13368",
        "fwd_position": "81329093cc8ef2c7",
    },
    "third_party.mujoco_warp._src.io": {
        "_calculate_max_contact_nnz": "48b1d316a101896f",
        "_body_pair_nnz": "5b4bcf36366aa084",
    },
    "third_party.mujoco_warp._src.support": {
        "jac_dof": "8f48a613029a60fb",
    },
    "third_party.mujoco_warp._src.math": {
        "upper_tri_index": "8ca898f451fd1a2b",
    },
    "third_party.mujoco_warp._src.render": {
        "_build_megakernel": "bccfe07f21d1d5a5",
        "_make_cast_ray": "671c12b0691f44ce",
        "render": "de80769d94014134",
    },
    "third_party.mujoco_warp._src.bvh": {
        "build_scene_bvh": "fa7f3038ff387137",
        "refit_scene_bvh": "f80015eb6e0c03bd",
        "_compute_bvh_bounds": "860bca86a059897c",
    },
    "third_party.mujoco_warp._src.ray": {
        "ray_mesh_with_bvh": "32d1427f32e8b74d",
        "RAY_TOL_REL": "1187132475a4431d",
        "RAY_TOL_ABS": "79cda40a9f6ea328",
    },
    "warp.ffi": {
        "jax_callable_variadic_tuple": "5e767a45cafcf17b",
    },
}
"""Of each function replaced or called, by module of MJX and name: the beginning of the SHA-256 of its source."""


@functools.cache
def mismatches() -> tuple[str, ...]:
    """All that differs from what our functions were written for: the version, and each function that has changed or is
    missing. Empty: they fit. Looked up once per process."""
    version = importlib.metadata.version(PACKAGE)
    found = [] if version == VERSION else [f"{PACKAGE} {version} is not {VERSION}"]
    for module, pins in PINS.items():
        for name, pin in pins.items():
            now = fingerprint(module, name)
            if now != pin:
                found.append(f"{module}.{name} {'is missing' if now == MISSING else 'has changed'}")
    return tuple(found)


def obstacles() -> tuple[str, ...]:
    """Why our functions do not run: `mismatches`, and nothing where `IG2MJ_TRY_KERNELS` is 1."""
    return () if os.environ.get(TRY) == "1" else mismatches()


def fingerprint(module: str, name: str) -> str:
    """The beginning of the SHA-256 of a function's source, or of a constant's value; "missing" where there is none."""
    try:
        found: Any = getattr(importlib.import_module(f"mujoco.mjx.{module}"), name)
    except (ImportError, AttributeError):
        return MISSING
    found = getattr(found, "func", found)  # of Warp's kernels and functions
    if not callable(found):
        return _beginning(repr(found))
    function = inspect.unwrap(found)
    quick = _beginning(_source(function))
    return quick if quick == PINS.get(module, {}).get(name) else _beginning(inspect.getsource(function))


def _beginning(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _source(function: Any) -> str:
    """The lines of a function up to the next that is not indented; `inspect.getsource`, a tenth of a second slower for
    all of them, knows where it ends in every case."""
    code = getattr(function, "__code__", None)
    if code is None:  # a class
        return ""
    lines = linecache.getlines(code.co_filename)[code.co_firstlineno - 1 :]
    begins = next((k for k, line in enumerate(lines) if line.startswith("def ")), 0)
    ends = next((k for k, line in enumerate(lines) if k > begins and line[:1].strip() not in ("", ")")), len(lines))
    while ends and not lines[ends - 1].strip():
        ends -= 1
    return "".join(lines[:ends])


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
