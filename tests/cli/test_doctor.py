"""`ig2mj doctor`: what counts as healthy, and that every lack names its fix."""

from __future__ import annotations

import json
import subprocess
import sys
import threading

import pytest
from packaging.requirements import Requirement

from ig2mj import cli
from ig2mj.diagnosis import checks as diagnosis
from ig2mj.diagnosis.checks import Check
from ig2mj.install_hint import requirements
from ig2mj.viewer import offscreen

GPU = ("NVIDIA H200", 580)


def by_name(checks: list[Check]) -> dict[str, Check]:
    return {c.name: c for c in checks}


def test_a_lacking_optional_thing_is_healthy_and_a_lacking_required_one_is_not():
    good = Check("g", "a", True, "", required=True)
    assert diagnosis.healthy([good, Check("g", "b", False, "none")])
    assert not diagnosis.healthy([good, Check("g", "b", False, "none", required=True)])


def test_a_package_that_is_absent_or_too_old_names_the_line_that_installs_it():
    checks = by_name(
        diagnosis.package_checks(
            [(Requirement(text), None) for text in ("numpy>=1000", "no-such-package==1.0", "rich")]
        )
    )
    assert not checks["numpy"].ok
    assert "but >=1000 is needed" in checks["numpy"].found
    assert checks["numpy"].fix.endswith('install "numpy>=1000"')
    assert checks["no-such-package"].found == "not installed"
    assert checks["rich"].ok
    assert all(c.required for c in checks.values())


def test_a_lacking_extra_is_optional_and_names_the_extra():
    (check,) = diagnosis.package_checks([(Requirement("no-such-package"), "learn"), (Requirement("rich"), "learn")])
    assert not check.ok
    assert not check.required
    assert check.fix.endswith('[learn]"')
    assert "no-such-package" in check.found
    assert "rich" not in check.found


def test_what_ig2mj_asks_for_is_installed_here():
    expected = requirements()
    assert diagnosis.healthy(diagnosis.package_checks(expected))
    assert {("mujoco", None), ("jax", None), ("coacd", "convert")} <= {(r.name, extra) for r, extra in expected}


@pytest.mark.parametrize(("driver", "extra"), [(580, "gpu"), (550, "gpu-cuda12")])
def test_a_gpu_that_jax_does_not_see_gets_the_extra_for_its_driver(driver, extra):
    jax = {"devices": ["cpu:0 cpu"], "backend": "cpu"}
    warp = {"devices": ["cpu CPU"], "cuda": [], "cache": "/tmp"}
    checks = by_name(diagnosis.accelerator_checks(jax, warp, ("NVIDIA H200", driver)))
    assert checks["JAX on CUDA"].fix.endswith(f'[{extra}]"')
    assert checks["Warp on CUDA"].fix
    assert diagnosis.healthy(checks.values())


def test_without_a_gpu_nothing_is_to_be_mended():
    jax = {"devices": ["cpu:0 cpu"], "backend": "cpu"}
    warp = {"devices": ["cpu CPU"], "cuda": [], "cache": "/tmp"}
    assert not any(c.fix for c in diagnosis.accelerator_checks(jax, warp, None))


@pytest.mark.parametrize("broken", ["jax", "warp"])
def test_a_library_that_does_not_start_is_unhealthy_and_named(broken):
    probes = {
        "jax": {"devices": ["cuda:0 H200"], "backend": "gpu"},
        "warp": {"devices": ["cpu CPU", "cuda:0 H200"], "cuda": ["H200"], "cache": "/tmp"},
    }
    probes[broken] = {"error": "ImportError: libfoo"}
    checks = diagnosis.accelerator_checks(probes["jax"], probes["warp"], GPU)
    assert not diagnosis.healthy(checks)
    assert [c.fix != "" for c in checks if not c.ok] == [True]


def test_one_rendering_backend_is_enough_and_none_at_all_is_told():
    checks = by_name(diagnosis.picture_checks({"egl": "no libEGL", "osmesa": None, "warp": None}))
    assert checks["osmesa"].ok
    assert "apt-get install" in checks["egl"].fix
    assert "any" not in checks
    checks = by_name(diagnosis.picture_checks({"egl": "a", "osmesa": "b", "warp": "c"}))
    assert not checks["any"].ok
    assert not checks["any"].required


def test_a_cache_folder_that_cannot_be_written_names_its_variable(monkeypatch, tmp_path):
    file = tmp_path / "file"
    file.write_text("x")
    monkeypatch.setenv("IG2MJ_CACHE_DIR", str(file / "cache"))
    check = by_name(diagnosis.cache_checks({}))["ig2mj (conversions)"]
    assert not check.ok
    assert "IG2MJ_CACHE_DIR" in check.fix


def test_cache_sizes_are_counted(monkeypatch, tmp_path):
    (tmp_path / "a").write_bytes(b"0" * 3 * 2**20)
    monkeypatch.setenv("IG2MJ_CACHE_DIR", str(tmp_path))
    assert "3 MiB in 1 files" in by_name(diagnosis.cache_checks({}))["ig2mj (conversions)"].found


def test_the_mujoco_probe_steps_in_a_process_of_its_own():
    assert diagnosis.mujoco_check(diagnosis.run_probe("mujoco")).ok


def test_a_probe_that_fails_hangs_or_is_killed_gives_one_line(monkeypatch):
    assert "KeyError" in diagnosis.run_probe("no_such_probe")["error"]

    def hang(*args, **kwargs):
        raise subprocess.TimeoutExpired("python", 5)

    def killed(*args, **kwargs):
        return subprocess.CompletedProcess(args, -11, "", "")

    monkeypatch.setattr(subprocess, "run", hang)
    assert "no answer" in diagnosis.run_probe("jax", timeout_s=5.0)["error"]
    monkeypatch.setattr(subprocess, "run", killed)
    assert diagnosis.run_probe("jax")["error"] == "was killed by signal 11"


@pytest.fixture
def found(monkeypatch):
    def use(*checks: Check) -> None:
        monkeypatch.setattr(diagnosis, "diagnose", lambda progress=None: list(checks))

    return use


def test_the_command_exits_1_only_if_something_required_is_broken(found, capsys):
    found(Check("machine", "display", False, "none [x]", fix="set DISPLAY"))
    assert cli.call(["doctor"]) == 0
    out = capsys.readouterr().out
    assert "none [x]" in out
    assert "-> set DISPLAY" in out
    found(Check("engines", "MuJoCo", False, "gone", required=True, fix="fix me"))
    assert cli.call(["doctor"]) == 1
    assert "BAD" in capsys.readouterr().out


def test_json_is_the_whole_report(found, capsys):
    found(Check("engines", "MuJoCo", False, "gone", required=True, fix="fix me"))
    assert cli.call(["doctor", "--json"]) == 1
    report = json.loads(capsys.readouterr().out)
    assert report["ok"] is False
    assert report["checks"] == [
        {"group": "engines", "name": "MuJoCo", "ok": False, "found": "gone", "required": True, "fix": "fix me"}
    ]


@pytest.mark.slow
def test_the_whole_doctor_runs_here_and_finds_this_installation_healthy():
    done = subprocess.run([sys.executable, "-m", "ig2mj", "doctor", "--json"], capture_output=True, text=True)
    report = json.loads(done.stdout)
    assert done.returncode == 0, [c for c in report["checks"] if c["required"] and not c["ok"]]
    assert {c["group"] for c in report["checks"]} == {"machine", "packages", "engines", "pictures", "tools", "caches"}


def test_progress_names_what_is_still_being_tried(monkeypatch):
    """`ig2mj doctor` shows it after two seconds (`process.waiting`)."""
    release = threading.Event()

    def slow(backend: str) -> None:
        assert release.wait(60)

    monkeypatch.setattr(offscreen, "probe", slow)
    monkeypatch.setattr(diagnosis, "run_probe", lambda name: {"error": "not tried"})
    said: list[str] = []

    def note(text: str) -> None:
        said.append(text)
        if "JAX" not in text and "Warp" not in text and "MuJoCo" not in text:
            release.set()

    diagnosis.diagnose(note)
    assert said[0] == "trying MuJoCo, JAX, Warp, rendering with egl, rendering with osmesa, rendering with warp"
    assert "trying rendering with egl, rendering with osmesa, rendering with warp" in said
