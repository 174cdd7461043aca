"""Set-up of the whole test suite.

JAX runs on the CPU with one thread per operation (set JAX_PLATFORMS yourself to run elsewhere), compiled programs are
kept below pytest's cache folder, and every function and dataclass of `ig2mj` that carries jaxtyping annotations has
its shapes and types checked by beartype while the tests run.
"""

from __future__ import annotations

import os
from pathlib import Path

os.environ.setdefault("JAX_PLATFORMS", "cpu")
if os.environ["JAX_PLATFORMS"] == "cpu":
    os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1")
os.environ.setdefault("XLA_PYTHON_CLIENT_PREALLOCATE", "false")

import jaxtyping
import pytest

try:
    import hypothesis
except ModuleNotFoundError:  # a GPU machine that runs only the tests that need it
    hypothesis = None

# Must stand before the first import of ig2mj: the hook works on modules as they are loaded.
jaxtyping.install_import_hook("ig2mj", "beartype.beartype")

if hypothesis is not None:
    hypothesis.settings.register_profile(
        "lean",
        max_examples=20,
        deadline=None,  # the first example compiles
        derandomize=True,
        database=None,
        suppress_health_check=[hypothesis.HealthCheck.too_slow, hypothesis.HealthCheck.function_scoped_fixture],
    )
    hypothesis.settings.load_profile("lean")

REPOSITORY = Path(__file__).resolve().parents[1]

collect_ignore = ["interop"]  # other projects' programs: `make test-interop`


def pytest_configure(config: pytest.Config) -> None:
    """Keep compiled JAX programs between runs, where pytest keeps a cache at all."""
    import jax

    if getattr(config, "cache", None) is not None:  # without its plugin there is no such attribute
        jax.config.update("jax_compilation_cache_dir", str(config.cache.mkdir("jax")))
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.3)


@pytest.fixture(scope="session")
def repository() -> Path:
    """Root folder of the checkout."""
    return REPOSITORY


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of test data that stands beside the checkout; tests that need it are skipped where it is absent."""
    folder = REPOSITORY.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"needs the test data in {folder}, which is not a part of the repository")
    return folder


@pytest.fixture(scope="module")
def gpu():
    """Everything of a file that uses this runs on the first CUDA device."""
    import jax

    try:
        device = jax.devices("cuda")[0]
    except RuntimeError:
        pytest.skip("JAX sees no CUDA device; on a machine that has one: make test-gpu")
    with jax.default_device(device):
        yield device


@pytest.fixture(scope="session")
def tiny_home_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a small home in the project's format, see tests/tiny_home.py."""
    from tiny_home import write_tiny_home

    return write_tiny_home(tmp_path_factory.mktemp("homes") / "tiny")


@pytest.fixture(scope="session")
def tiny_home(tiny_home_folder: Path):
    """The small home, loaded. Nothing of a Scene changes during a run, so tests share it."""
    import ig2mj

    return ig2mj.load_scene(tiny_home_folder)
