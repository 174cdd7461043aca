"""Who may open the pages of this machine: the address they are served at, the token they demand, their certificate."""

from __future__ import annotations

import dataclasses
import ipaddress
import os
import pathlib
import re
import secrets
import socket
import ssl

from ig2mj.errors import Ig2mjError, InputError

LOOPBACK = "127.0.0.1"
SHORTEST_TOKEN = 16
"""Characters. Wrong tokens are not slowed down, so that a token must not be guessed."""


@dataclasses.dataclass(frozen=True)
class Access:
    """Where pages are served, and to whom. Make it with `access_for`, which holds the rules.

    Attributes:
      host: address to listen on. port: 0: any free one. token: what a page demands; None: nothing.
      tls: the certificate's context; None: plain HTTP.
    """

    host: str
    port: int
    token: str | None = None
    tls: ssl.SSLContext | None = None

    @property
    def loopback(self) -> bool:
        """Whether only this machine can reach the pages."""
        return is_loopback(self.host)

    def listen(self) -> socket.socket:
        """The socket, bound and listening. Raises Ig2mjError: the port is taken, or the address is not ours."""
        family = socket.AF_INET6 if ":" in self.host else socket.AF_INET
        try:
            return socket.create_server((self.host, self.port), family=family)
        except OSError as e:
            where = f"port {self.port} of {self.host}"
            raise Ig2mjError(f"{where}: {e.strerror or e} (--port 0 takes any free one)") from e

    def url(self, port: int, token: bool = False) -> str:
        """Address of the first page; `token`: with the token in it, so that a click is enough."""
        everywhere = self.host in ("0.0.0.0", "::")
        name = socket.gethostname() if everywhere else f"[{self.host}]" if ":" in self.host else self.host
        query = f"?token={self.token}" if token and self.token is not None else ""
        return f"{'http' if self.tls is None else 'https'}://{name}:{port}/{query}"


def access_for(
    host: str | None = None,
    port: int = 8080,
    token: str | None = None,
    certificate: str | os.PathLike | None = None,
    key: str | os.PathLike | None = None,
) -> Access:
    """The rules: loopback only, unless a host is named together with a token.

    Args:
      host: name or address to listen on; None: loopback. "0.0.0.0" is every network of this machine.
      port: 0: any free one.
      token: what pages demand, at least 16 letters, digits, "-" and "_"; "auto" draws one.
      certificate, key: PEM files of a certificate, with which the pages are served by HTTPS; `key` may be in the same
        file.

    Raises:
      Ig2mjError: a host that others can reach without a token, a token that is too short, a port that cannot be.
      InputError: the certificate cannot be read.
    """
    where = LOOPBACK if host is None else host.strip()
    if not where:
        raise Ig2mjError("--host is empty; leave it out for this machine alone")
    if not 0 <= port <= 65535:
        raise Ig2mjError(f"--port {port}: is not between 0 and 65535")
    if token == "auto":
        token = secrets.token_urlsafe(24)
    if token is None and not is_loopback(where):
        raise Ig2mjError(f"--host {where} lets other machines in: it needs --token TEXT (--token auto draws one)")
    if token is not None and (len(token) < SHORTEST_TOKEN or not _is_plain(token)):
        raise Ig2mjError(
            f"--token: at least {SHORTEST_TOKEN} letters, digits, '-' and '_' are needed (--token auto draws one)"
        )
    if certificate is None and key is not None:
        raise Ig2mjError("--key needs --certificate")
    return Access(where, port, token, None if certificate is None else _tls(certificate, key))


def is_loopback(host: str) -> bool:
    """Whether an address or name is this machine's own; names other than localhost count as not."""
    bracketed = host.startswith("[") and host.endswith("]")
    name = (host[1:-1] if bracketed else host).rstrip(".").lower()
    if re.fullmatch(r"(?:[a-z0-9-]+\.)*localhost", name, re.ASCII):
        return True
    try:
        return ipaddress.ip_address(name).is_loopback
    except ValueError:
        return False


def _is_plain(token: str) -> bool:
    return token.isascii() and token.replace("-", "").replace("_", "").isalnum()


def _tls(certificate: str | os.PathLike, key: str | os.PathLike | None) -> ssl.SSLContext:
    for file in (certificate, key):
        if file is not None and not pathlib.Path(file).is_file():
            raise InputError(file, "there is no such file", fix="--certificate and --key name PEM files")
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    try:
        context.load_cert_chain(certificate, key, password=_no_password)
    except (OSError, ssl.SSLError, ValueError) as e:
        fix = "--certificate names a PEM file, and --key that of its private key, without a password"
        raise InputError(certificate, f"is not a certificate with its key: {e}", fix=fix) from e
    return context


def _no_password() -> str:
    """Instead of OpenSSL's question in the terminal."""
    raise ValueError("the key has a password")
