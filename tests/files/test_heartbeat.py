"""Signs of life: who works on a folder, judged by more than the number of a process."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
import types

import pytest

from ig2mj.cluster import locks
from ig2mj.cluster.locks import hold
from ig2mj.errors import ClusterError
from ig2mj.files import heartbeat
from ig2mj.files.heartbeat import DEAD, Heartbeat, identity, is_alive, lives


def ended() -> dict:
    """The identity of a process that has ended."""
    code = "import json; from ig2mj.files.heartbeat import identity; print(json.dumps(identity()))"
    return json.loads(subprocess.run([sys.executable, "-c", code], capture_output=True, check=True).stdout)


def grow_old(file, seconds: float = DEAD + 5) -> None:
    then = time.time() - seconds
    os.utime(file, (then, then))


FOREIGN = {"host": "other", "boot": "another start", "namespace": "pid:[1]", "process": 1, "started": "5"}


def test_a_process_of_this_machine_lives_until_it_ends():
    own = identity()
    assert lives(own) is True
    assert lives(ended()) is False
    assert lives(own | {"started": "1"}) is False, "another process has its number now"
    assert lives(own | {"namespace": "pid:[1]"}) is None, "of another container, whose process 1 is not ours"
    assert lives(FOREIGN) is None
    assert lives({"process": "1"}) is None and lives([]) is None


def test_a_sign_of_this_machine_is_believed_whatever_its_age(tmp_path):
    with Heartbeat(tmp_path / "sign") as sign:
        grow_old(sign.file)
        assert is_alive(sign.file), "a process that was stopped for minutes still has its folder"
    assert not sign.file.exists()
    (tmp_path / "sign").write_text(json.dumps(ended()))
    assert not is_alive(tmp_path / "sign")


@pytest.mark.parametrize("text", [json.dumps(FOREIGN), "", "no JSON", "[" * 5000, "{}"])
def test_a_sign_of_another_machine_is_believed_for_two_minutes(text, tmp_path):
    sign = tmp_path / "sign"
    sign.write_text(text)
    assert is_alive(sign)
    grow_old(sign, DEAD - 10)
    assert is_alive(sign)
    grow_old(sign)
    assert not is_alive(sign)


def test_what_has_no_sign_yet_is_judged_by_its_own_age(tmp_path):
    folder = tmp_path / "folder"
    folder.mkdir()
    assert is_alive(folder / "sign", folder) and not is_alive(folder / "sign")
    grow_old(folder)
    assert not is_alive(folder / "sign", folder)


def test_ages_are_of_the_disks_clock(tmp_path, monkeypatch):
    """A machine whose clock is an hour ahead takes nobody for dead."""
    (tmp_path / "sign").write_text(json.dumps(FOREIGN))
    now = time.time()
    monkeypatch.setattr(heartbeat.time, "time", lambda: now + 3600)
    assert is_alive(tmp_path / "sign")
    assert [file.name for file in tmp_path.iterdir()] == ["sign"]


def test_a_sign_is_touched_as_long_as_it_is_open(tmp_path, monkeypatch):
    monkeypatch.setattr(heartbeat, "BEAT", 0.01)
    monkeypatch.setattr(heartbeat, "_beating", heartbeat._Beating())
    beats = [threading.Event(), threading.Event()]
    signs = [types.SimpleNamespace(touch=event.set) for event in beats]
    for sign in signs:
        heartbeat.keep_touching(sign)
    assert all(event.wait(10) for event in beats)
    for sign in signs:
        heartbeat.stop_touching(sign)
    with Heartbeat(tmp_path / "sign") as sign:
        grow_old(sign.file)
        sign.touch()
        assert heartbeat.age(sign.file) < DEAD


def test_an_output_that_another_machine_holds_is_refused_until_it_is_silent(tmp_path):
    """As on a network disk that keeps locks to one machine: the lock is free, and the sign of life is not."""
    lock = tmp_path / "lock"
    lock.write_text(json.dumps(FOREIGN))
    with pytest.raises(ClusterError, match=r"out: process 1 on other was writing there \d+ s ago; .* after 120 s"):
        hold(lock, "out")
    grow_old(lock)
    with hold(lock, "out"):
        assert json.loads(lock.read_text()) == identity()
    assert lock.read_text() == ""


def test_on_one_machine_the_lock_decides(tmp_path):
    """Of another container of this machine, whose lock this kernel would know; of a process that was killed."""
    lock = tmp_path / "lock"
    for who in (identity() | {"namespace": "pid:[1]", "process": 1}, ended()):
        lock.write_text(json.dumps(who))
        hold(lock, "out").close()
    with hold(lock, "out"), pytest.raises(ClusterError, match=rf"process {os.getpid()} on .* is writing there"):
        hold(lock, "out")


def test_on_a_disk_without_locks_the_sign_of_life_decides(tmp_path, monkeypatch):
    def no_locks(*_):
        raise OSError(locks.errno.ENOLCK, "No locks available")

    monkeypatch.setattr(locks.fcntl, "flock", no_locks)
    lock = tmp_path / "lock"
    with hold(lock, "out"), pytest.raises(ClusterError, match="was writing there"):
        hold(lock, "out")
    hold(lock, "out").close()
