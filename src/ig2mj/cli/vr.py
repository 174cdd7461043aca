"""`ig2mj vr TASK`: a person does a task, in a headset or with mouse and keyboard."""

from __future__ import annotations

import pathlib
from typing import TYPE_CHECKING, Annotated

import tyro

from ig2mj.cli.common.objects import AddedObjects
from ig2mj.files.shell import command

if TYPE_CHECKING:
    from ig2mj.vr.session import Session

DEVICES = ("page", "openxr", "recorded")


def run(
    task: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="TASK")],
    record: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None,
    device: str = "page",
    poses: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None,
    host: str | None = None,
    port: int = 8090,
    token: str | None = None,
    certificate: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="PEM")] = None,
    key: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="PEM")] = None,
    grasping: str = "assisted",
    seed: int = 0,
    row: int = -1,
    pool_size: int = 0,
    object: AddedObjects = (),
    seconds: float = 0.0,
    timing: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
) -> int:
    """Do a task yourself, in a headset or with mouse and keyboard. Ctrl-C ends it.

    Args:
      task: a task of the humanoid, e.g. CookingMeat or activity/cleaning_windows (`ig2mj list-envs` names them), or one
        of a file of yours: my_tasks.py:MugToTable.
      record: HDF5 file to record the session and your devices to, for `ig2mj demos replay`.
      device: page: a web page for a headset's browser (WebXR) or for mouse and keyboard; openxr: a headset attached to
        this machine; recorded: play back the devices of --poses.
      poses: the recording whose devices are played back.
      host: address to serve the page on; default: this machine alone. Others need --token and, for headsets,
        --certificate.
      port: port of the page; 0: any free port.
      token: secret that the page asks for; auto: a random one.
      certificate: PEM file with your certificate, to serve the page by HTTPS.
      key: PEM file with the certificate's private key, if it is a separate file.
      grasping: assisted, sticky, mitten or physical.
      seed: random seed.
      row: number of the start state; -1: a random one.
      pool_size: number of start states; 0: all that the task has, or a few where they are sampled first.
      object: {object}.
      seconds: end after this many seconds; 0: run until you end it.
      timing: show every two seconds how a frame's time divides into physics, states, rendering and waiting.
    """
    import math

    from ig2mj.errors import Ig2mjError, UnknownNameError

    if device not in DEVICES:
        raise UnknownNameError("device", device, DEVICES)
    if (poses is not None) != (device == "recorded"):
        raise Ig2mjError("--poses FILE needs --device recorded")
    if not math.isfinite(seconds) or seconds < 0 or row < -1 or pool_size < 0:
        raise Ig2mjError("--seconds must be finite, --seconds, --row and --pool-size not negative")
    if device != "page" and any(value is not None for value in (host, token, certificate, key)):
        raise Ig2mjError("--host, --token, --certificate and --key need --device page")
    common = {"record_to": record, "seed": seed, "row": None if row < 0 else row}
    if device == "page":
        from ig2mj.vr.server import check_page
        from ig2mj.web.access import access_for

        check_page()
        access = access_for(host, port, token, certificate, key)
    env = _environment(task, grasping, pool_size, row, object)
    if device == "page":
        return _serve(env, access, common, seconds, timing)
    if device == "openxr":
        from ig2mj.vr.openxr.session import run_headset

        return _ended(run_headset(env, common, seconds, timing), common)
    assert poses is not None
    return _repeat(env, poses, common)


def _environment(task: str, grasping: str, pool_size: int, row: int, objects: tuple[str, ...]):
    from ig2mj.cli.common.objects import note_changes
    from ig2mj.cli.common.tasks import ROWS, few_rows
    from ig2mj.errors import Ig2mjError
    from ig2mj.vr.session import person_environment

    rows = pool_size or few_rows(task, "train", max(ROWS, row + 1), objects, grasping)
    env = person_environment(task, grasping, pool_size=rows or None, objects=objects)
    note_changes(env.scene, objects)
    if row >= env.core.starts.pool.size:
        raise Ig2mjError(f"--row {row}: the task has start states 0 to {env.core.starts.pool.size - 1}")
    return env


def _serve(env, access, common: dict, seconds: float, timing: bool) -> int:
    import sys

    from ig2mj.vr.page_source import PagePoses
    from ig2mj.vr.server import HomePage
    from ig2mj.vr.session import Session

    source = PagePoses()
    with Session(env, source, person=_remark, **common) as session, HomePage(session, source, access, timing) as page:
        print(f"{env.task.name}: {env.task.summary}", file=sys.stderr)
        print(f"open {page.server.url}", flush=True)
        print("Ctrl-C ends the session", file=sys.stderr)
        _play(session, seconds, timing, lambda: page.rate)
    return _ended(session, common)


def _repeat(env, poses: pathlib.Path, common: dict) -> int:
    from ig2mj.vr.recorded import RecordedPoses
    from ig2mj.vr.session import Session

    source = RecordedPoses(poses)
    with Session(env, source, person=_remark, **common) as session:
        while not source.over:
            session.step()
    return _ended(session, common)


def _play(session: Session, seconds: float, timing: bool, rate) -> None:
    """Runs a session until it ends; prints its timing from another thread."""
    import sys
    import threading

    stop = threading.Event()

    def tell() -> None:
        while not stop.wait(2.0):
            drawn = rate()
            images = "" if drawn is None else f"   images {drawn.pictures:.0f}/s, slowest {drawn.slowest:.0f} ms"
            print(f"{session.timing.line()}{images}", file=sys.stderr, flush=True)

    if timing:
        threading.Thread(target=tell, daemon=True).start()
    try:
        session.run(seconds or None)
    except KeyboardInterrupt:
        print("", file=sys.stderr)
    finally:
        stop.set()


def _ended(session: Session, common: dict) -> int:
    print(f"goal {'reached' if session.succeeded else 'not reached'}")
    if common["record_to"] is not None:
        replay = command("demos", "replay", common["record_to"], "--check")
        print(f"wrote {common['record_to']}; `{replay}` replays it")
    return 0


def _remark(text: str) -> None:
    import sys

    print(text, file=sys.stderr, flush=True)
