"""`ig2mj web`: what it refuses, in one line, before anything is loaded."""

from __future__ import annotations

import socket

import pytest

pytest.importorskip("viser")

from ig2mj import cli


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["brich"], "near matches: birch"),
        (["CookingMaet"], "near matches: CookingMeat"),
        (["birch", "--host", "0.0.0.0"], "needs --token"),
        (["birch", "--host", "0.0.0.0", "--token", "short"], "at least 16"),
        (["birch", "--port", "70000"], "65535"),
        (["birch", "--certificate", "no.pem"], "no.pem"),
        (["birch", "--key", "no.pem"], "--certificate"),
        (["birch", "--worlds", "0"], "at least one"),
        (["birch", "--engine", "wrap"], "near matches: warp"),
        (["birch", "--agent", "expert"], "for a task"),
        (["birch", "--goal", "(and (open"], "--goal"),
        (["CookingMeat", "--goal", "(open x)"], "tasks and recordings have their own"),
        (["CookingMeat", "--agent", "experrt"], "near matches: expert"),
        (["missing.h5"], "no such file"),
    ],
)
def test_bad_usage_is_one_line(capsys, options, says):
    assert cli.call(["web", *options]) == 2
    error = capsys.readouterr().err.strip().splitlines()[-1]
    assert error.startswith("error: ") and says in error


def test_a_file_that_is_no_recording_is_named(capsys, tmp_path):
    file = tmp_path / "runs.h5"
    file.write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(100))
    assert cli.call(["web", str(file)]) == 2
    assert "runs.h5" in capsys.readouterr().err


def test_a_port_that_is_taken_is_told_before_anything_is_loaded(capsys):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert cli.call(["web", "birch", "--port", str(port)]) == 2
    error = capsys.readouterr().err
    assert f"port {port}" in error and "loading" not in error
