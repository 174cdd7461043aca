"""Set-up of the whole test suite.

JAX runs on the CPU with one thread per operation (set JAX_PLATFORMS yourself to run elsewhere), compiled programs are
kept below pytest's cache folder, and every function and dataclass of `ig2mj` that carries jaxtyping annotations has
its shapes and types checked by beartype while the tests run.
"""

from __future__ import annotations

import gc
import importlib.metadata
import os
import re
from pathlib import Path

os.environ.setdefault("JAX_PLATFORMS", "cpu")
if os.environ["JAX_PLATFORMS"] == "cpu" and "XLA_FLAGS" not in os.environ:
    flags = ["--xla_cpu_multi_thread_eigen=false", "intra_op_parallelism_threads=1"]
    # `make test`: kernels are then compiled without MLIR, too. XLA ends the process at a flag that it does not know.
    if os.environ.get("JAX_DISABLE_MOST_OPTIMIZATIONS") == "1" and importlib.metadata.version("jax").startswith(
        "0.10."
    ):
        flags.append("--xla_cpu_use_fusion_emitters=false")
    os.environ["XLA_FLAGS"] = " ".join(flags)
os.environ.setdefault("XLA_PYTHON_CLIENT_PREALLOCATE", "false")

import jaxtyping
import pytest

try:
    import hypothesis
except ModuleNotFoundError:  # a GPU machine that runs only the tests that need it
    hypothesis = None

SOURCE = Path(__file__).resolve().parents[1] / "src"


def annotated_modules() -> list[str]:
    """Modules that use jaxtyping, and those that check arrays against its annotations by hand (their scope of names of
    axes begins with the function) or replace the constructor of a class that is checked. Checks of
    all others take a tenth of the suite's time."""
    files = (file for file in sorted((SOURCE / "ig2mj").rglob("*.py")) if file.name != "__init__.py")
    checked = re.compile(r"jaxtyping|get_type_hints|\.__init__ = ")
    annotated = (file for file in files if checked.search(file.read_text(encoding="utf-8")))
    return [".".join(file.relative_to(SOURCE).with_suffix("").parts) for file in annotated]


# Must stand before the first import of ig2mj: the hook works on modules as they are loaded.
jaxtyping.install_import_hook(annotated_modules(), "beartype.beartype")

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
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)


def pytest_collection_finish() -> None:
    """What is there for good is never searched for garbage again: that takes a second at a time."""
    gc.collect()
    gc.freeze()


SHARING = {
    "tests/homes/test_rooms_look_lived_in.py": "tests/homes/test_furnishing.py",  # every home, furnished
    "tests/demos/test_recordings.py": "tests/envs/test_environment.py",  # `cooking_meat`
    "tests/demos/test_exports.py": "tests/envs/test_environment.py",
}
"""Files that run in the process of another, because they share something that takes long to make."""


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log):
    """`--dist loadfile`, but for the files above."""
    if config.getvalue("dist") != "loadfile":
        return None
    from xdist.scheduler import LoadFileScheduling

    class Sharing(LoadFileScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file = super()._split_scope(nodeid)
            return SHARING.get(file, file)

    return Sharing(config, log)


@pytest.fixture(scope="session", autouse=True)
def _programs_from_shapes():
    """JAX describes arguments of a lowered program in trees whose leaves are no arrays: not checked there."""
    from ig2mj.process.gc_pause import Compiled, Traced

    def unchecked(method):
        def call(self, *args):
            jaxtyping.config.update("jaxtyping_disable", True)
            try:
                return method(self, *args)
            finally:
                jaxtyping.config.update("jaxtyping_disable", False)

        return call

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Compiled, "traced", unchecked(Compiled.traced))
        patch.setattr(Traced, "compiling", unchecked(Traced.compiling))
        yield


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


@pytest.fixture
def registered():
    """What a test registers (`ig2mj.register`) is forgotten after it."""
    import registries

    with registries.restored():
        yield


@pytest.fixture(scope="session")
def cooking_meat():
    """CookingMeat with the humanoid in two worlds, and a pool of four; shared, since it takes long to compile."""
    import ig2mj

    return ig2mj.make("CookingMeat", worlds=2, engine="native", pool_size=4)


@pytest.fixture(scope="session")
def cup(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of an object of one's own, see tests/own_objects.py."""
    from own_objects import write_cup

    return write_cup(tmp_path_factory.mktemp("objects"))


@pytest.fixture
def own_configuration(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A user's configuration of the test alone, without libraries of objects."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "configuration"))
    monkeypatch.delenv("IG2MJ_OBJECTS", raising=False)
    return tmp_path / "configuration"
