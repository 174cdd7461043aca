"""The gate before pages and web sockets: who is let in, and what ends a connection without harming anything else."""

from __future__ import annotations

import asyncio
import os
import random
import socket
import ssl
import subprocess
import sys
import urllib.error
import urllib.request

import pytest

pytest.importorskip("websockets")

from websockets.asyncio.client import connect as asyncio_connect
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from ig2mj.errors import Ig2mjError, InputError
from ig2mj.web.access import access_for, is_loopback
from ig2mj.web.serving import BURST, Pages, PageServer

TOKEN = "a-token-of-twenty-letters"


async def echo(connection) -> None:
    async for message in connection:
        await connection.send(message)


def only_ping(message) -> bool:
    if message not in ("ping", "unwanted"):
        raise ValueError(message)
    return message == "ping"


def serving(token: str | None = None, **options) -> PageServer:
    return PageServer(access_for(None, 0, token), Pages({"": b"<p>home</p>", "a.js": b"1"}), echo, only_ping, **options)


def get(server: PageServer, path: str = "/", **headers: str) -> tuple[int, bytes]:
    scheme = "http" if server.gate.access.tls is None else "https"
    request = urllib.request.Request(f"{scheme}://127.0.0.1:{server.port}{path}", headers=headers)
    try:
        with urllib.request.build_opener(_NoRedirect).open(request, timeout=10) as answer:
            return answer.status, answer.read()
    except urllib.error.HTTPError as e:
        with e:
            return e.code, e.read() or dict(e.headers).get("Set-Cookie", "").encode()


class _NoRedirect(urllib.request.HTTPRedirectHandler):
    def redirect_request(self, *args, **kwargs):
        return None


def talk(server: PageServer, message: str = "ping", **headers: str) -> str | bytes:
    with connect(f"ws://127.0.0.1:{server.port}/", additional_headers=headers, open_timeout=10) as page:
        page.send(message)
        return page.recv(timeout=10)


def test_without_a_host_only_this_machine_is_served():
    access = access_for()
    assert access.loopback and access.token is None and access.host == "127.0.0.1"
    assert is_loopback("localhost") and is_loopback("::1") and is_loopback("127.3.2.1")
    assert not is_loopback("0.0.0.0") and not is_loopback("192.168.1.2") and not is_loopback("localhost.evil.example")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"host": "0.0.0.0"}, "--token"),
        ({"host": "192.168.0.7"}, "--token"),
        ({"host": "::"}, "--token"),
        ({"host": "0.0.0.0", "token": "short"}, "16"),
        ({"host": "0.0.0.0", "token": "with spaces and more spaces"}, "letters"),
        ({"host": ""}, "empty"),
        ({"port": 70000}, "65535"),
        ({"key": "key.pem"}, "--certificate"),
    ],
)
def test_what_would_let_strangers_in_is_refused_in_one_line(options, words):
    with pytest.raises(Ig2mjError, match=words):
        access_for(**options)


def test_a_drawn_token_is_long_and_new_each_time():
    first, second = (access_for("0.0.0.0", token="auto").token for _ in range(2))
    assert first and second and first != second and len(first) >= 32
    assert first in access_for("0.0.0.0", 0, first).url(8080, token=True)
    assert first not in access_for("0.0.0.0", 0, first).url(8080)


def test_a_port_that_is_taken_is_one_line():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(Ig2mjError, match=f"port {port} of 127.0.0.1"):
            access_for(None, port).listen()


def test_pages_and_web_sockets_of_loopback_need_no_token():
    with serving() as server:
        assert get(server) == (200, b"<p>home</p>")
        assert get(server, "/a.js?x=1") == (200, b"1")
        assert get(server, "/../../etc/passwd")[0] == 404
        assert get(server, "/%2e%2e/secrets")[0] == 404
        assert talk(server) == "ping"


def test_a_page_demands_the_token_and_keeps_it_out_of_the_address():
    with serving(TOKEN) as server:
        assert get(server)[0] == 401 and b'name="token"' in get(server)[1]
        assert get(server, "/a.js")[0] == 401
        assert get(server, "/?token=wrong-wrong-wrong-wrong")[0] == 401
        status, cookie = get(server, f"/?token={TOKEN}")
        assert status == 303 and TOKEN.encode() not in cookie and b"HttpOnly" in cookie
        mine = cookie.decode().partition(";")[0]
        assert get(server, Cookie=mine) == (200, b"<p>home</p>")
        assert talk(server, Cookie=mine) == "ping"


def test_a_web_socket_without_the_token_is_refused():
    with serving(TOKEN) as server:
        for headers in ({}, {"Cookie": "ig2mj_1=guess"}, {"Cookie": f"ig2mj_{server.port}={TOKEN}"}):
            with pytest.raises(InvalidStatus, match="401"):
                talk(server, **headers)


def test_another_sites_page_gets_nothing():
    """Neither by a web socket of its own, nor by a name that it lets point here."""
    with serving() as server:
        with pytest.raises(InvalidStatus, match="403"):
            talk(server, Origin="https://evil.example")
        assert talk(server, Origin=f"http://127.0.0.1:{server.port}") == "ping"
        assert get(server, Host="evil.example")[0] == 403
        assert get(server, Host=f"localhost:{server.port}")[0] == 200


def test_an_unwanted_message_is_dropped_and_the_page_stays():
    with serving() as server, connect(f"ws://127.0.0.1:{server.port}/") as page:
        page.send("unwanted")
        page.send("ping")
        assert page.recv(timeout=10) == "ping"


@pytest.mark.slow
def test_a_thousand_bad_messages_and_requests_harm_nobody():
    """Wrong tokens, malformed and oversized messages, bytes that are no HTTP: each ends its own connection alone."""
    random.seed(0)
    with serving() as server, connect(f"ws://127.0.0.1:{server.port}/") as good:
        for k in range(1000):
            kind = k % 4
            if kind == 0:
                with pytest.raises(ConnectionClosed) as closed:
                    talk(server, "not a ping")
                assert closed.value.rcvd and closed.value.rcvd.code == 1008
            elif kind == 1:
                with pytest.raises(ConnectionClosed) as closed:
                    talk(server, "x" * 70_000)
                assert closed.value.rcvd and closed.value.rcvd.code == 1009
            elif kind == 2:
                with socket.create_connection(("127.0.0.1", server.port)) as raw:
                    raw.sendall(random.randbytes(200) + b"\r\n\r\n")
            else:
                with pytest.raises(InvalidStatus):
                    talk(server, Origin="http://evil.example")
            if k % 100 == 0:
                good.send("ping")
                assert good.recv(timeout=10) == "ping"
        assert get(server)[0] == 200
        assert server.gate.refused >= 500


def test_a_page_that_floods_is_cut_off():
    with serving() as server, connect(f"ws://127.0.0.1:{server.port}/", max_queue=None) as page:
        with pytest.raises(ConnectionClosed) as closed:
            for _ in range(int(BURST) + 2000):
                page.send("ping")
            while True:
                page.recv(timeout=10)
        assert closed.value.rcvd and closed.value.rcvd.reason == "too many messages"


@pytest.fixture(scope="module")
def certificate(tmp_path_factory) -> tuple[str, str]:
    folder = tmp_path_factory.mktemp("tls")
    names = (os.fspath(folder / "cert.pem"), os.fspath(folder / "key.pem"))
    command = ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes"]
    command += ["-subj", "/CN=localhost", "-days", "1", "-out", names[0], "-keyout", names[1]]
    try:
        subprocess.run(command, check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("needs openssl")
    return names


def test_a_certificate_makes_it_https(certificate):
    access = access_for("127.0.0.1", 0, TOKEN, *certificate)
    with PageServer(access, Pages({"": b"home"}), echo) as server:
        assert server.url.startswith("https://127.0.0.1:")
        trusting = ssl.create_default_context(cafile=certificate[0])
        trusting.check_hostname = False

        async def greet() -> None:
            # One thread: an SSL object of Python 3.11 is not made for the two of the synchronous client.
            async with asyncio_connect(f"wss://127.0.0.1:{server.port}/", ssl=trusting):
                pass

        with pytest.raises(InvalidStatus, match="401"):
            asyncio.run(greet())


def test_a_broken_certificate_is_one_line(certificate, tmp_path):
    broken = tmp_path / "broken.pem"
    broken.write_text("no certificate")
    with pytest.raises(InputError, match=r"broken\.pem"):
        access_for("127.0.0.1", 0, TOKEN, broken, certificate[1])
    with pytest.raises(InputError, match=r"missing\.pem"):
        access_for("127.0.0.1", 0, TOKEN, tmp_path / "missing.pem")


def test_stopping_ends_pages_and_frees_the_port():
    server = serving()
    server.start()
    with connect(f"ws://127.0.0.1:{server.port}/") as page:
        server.stop()
        with pytest.raises(ConnectionClosed):
            page.recv(timeout=10)
    access_for(None, server.port).listen().close()
    server.stop()


def test_files_named_by_their_content_may_be_kept_and_nothing_else():
    pages = Pages({"": b"page", "a-1.js": b"x" * 1000}, lasting=["a-1.js"])
    with PageServer(access_for(None, 0), pages, echo) as server:
        kept = {}
        for path in ("/", "/a-1.js"):
            with urllib.request.urlopen(f"{server.url}{path[1:]}", timeout=10) as answer:
                kept[path] = answer.headers.get_all("Cache-Control"), answer.read()
    assert kept["/"] == (["no-store"], b"page")
    assert kept["/a-1.js"] == (["private, max-age=31536000, immutable"], b"x" * 1000)


def status_of(server: PageServer, target: str, host: str | None = None) -> int:
    """Of a request written by hand: clients correct what is odd."""
    lines = [f"GET {target} HTTP/1.1", *([] if host == "" else [f"Host: {host or f'localhost:{server.port}'}"])]
    with socket.create_connection(("127.0.0.1", server.port), timeout=10) as raw:
        raw.sendall("\r\n".join([*lines, "", ""]).encode())
        answer = raw.makefile("rb").readline()
    return int(answer.split()[1])


@pytest.mark.parametrize("token", [None, TOKEN])
def test_odd_addresses_are_bad_requests(token):
    with serving(token) as server:
        assert [status_of(server, target) for target in ("//[", "//[/a.js", "http://[")] == [400] * 3
        expected = 200 if token is None else 401
        assert status_of(server, "/") == expected


@pytest.mark.parametrize(
    "host",
    [
        "evil.example@127.0.0.1",
        "evil.example:80@127.0.0.1",
        "evil.example@a.localhost",
        "evil.example/.localhost",
        "evil.example#.localhost",
        "127.0.0.1.evil.example",
        "[evil.example].localhost",
        "[127.0.0.1",
        "localhost:port",
        "localhost:8080:8080",
        "",
    ],
)
def test_hosts_that_only_look_like_this_machine_are_refused(host):
    assert not is_loopback(host)
    with serving() as server:
        assert status_of(server, "/", host) in (400, 403)
        assert status_of(server, "/", "[::1]") == 200


def test_many_unwanted_messages_do_not_pile_up(monkeypatch):
    """More in one go than Python's stack is deep."""
    monkeypatch.setattr("ig2mj.web.serving.BURST", 1e9)
    monkeypatch.setattr("ig2mj.web.serving.MESSAGES_PER_SECOND", 1e9)
    with serving() as server, connect(f"ws://127.0.0.1:{server.port}/", open_timeout=10) as page:
        for _ in range(3 * sys.getrecursionlimit()):
            page.send("unwanted")
        page.send("ping")
        assert page.recv(timeout=30) == "ping"
