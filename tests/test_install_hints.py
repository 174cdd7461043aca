"""Lines that tell how to install what is missing: they must work as they stand."""

from __future__ import annotations

import json
import types

import pytest

from ig2mj import install_hint
from ig2mj.install_hint import CHECKOUT, pip_install_extra, pip_install_module


def test_from_a_checkout_an_extra_is_installed_from_its_folder(monkeypatch, tmp_path):
    monkeypatch.chdir(CHECKOUT)
    assert pip_install_extra("demo").endswith('pip install -e ".[demo]"')
    monkeypatch.chdir(tmp_path)
    assert pip_install_extra("demo").endswith(f'pip install -e "{CHECKOUT}[demo]"')


@pytest.mark.parametrize(
    ("record", "what"),
    [
        (None, "ig2mj[demo]"),
        ({"url": "file:///a/ig2mj", "dir_info": {}}, "ig2mj[demo] @ file:///a/ig2mj"),
        (
            {"url": "https://host/ig2mj", "vcs_info": {"vcs": "git", "commit_id": "1"}},
            "ig2mj[demo] @ git+https://host/ig2mj",
        ),
    ],
    ids=["index", "folder", "git"],
)
def test_elsewhere_it_is_installed_from_where_ig2mj_came_from(monkeypatch, tmp_path, record, what):
    monkeypatch.setattr(install_hint, "CHECKOUT", tmp_path)
    recorded = types.SimpleNamespace(read_text=lambda name: record and json.dumps(record))
    monkeypatch.setattr(install_hint.importlib.metadata, "distribution", lambda name: recorded)
    assert pip_install_extra("demo").endswith(f'pip install "{what}"')


@pytest.mark.parametrize(
    ("module", "end"),
    [
        ("coacd", '[convert]"'),
        ("collada", '[convert]"'),
        ("imageio_ffmpeg", '[demo]"'),
        ("matplotlib.pyplot", '[demo]"'),
        ("PIL.Image", 'install "pillow>=10"'),
        ("warp", 'install "warp-lang==1.18.0"'),
        ("no_such_module", 'install "no-such-module"'),
    ],
)
def test_a_module_is_installed_by_the_extra_or_the_requirement_that_asks_for_it(module, end):
    assert pip_install_module(module).endswith(end)
