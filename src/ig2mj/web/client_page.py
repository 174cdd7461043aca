"""viser's page in the form in which a browser opens it soonest.

viser keeps its page in one file: style sheet and program are compressed, written as text, unpacked by a program in the
page, and compiled each time that the page is opened. Here they are files of their own, which a browser compiles
while it loads them and keeps compiled; they are named by their content, so that it may keep them for good. The program
begins without the lights and the environment map that it would otherwise prepare before it hears which lights the home
has: where a browser draws in software, those alone take a second. It shows colours as they are sent, without the
contrast of a film that it would otherwise give them.
"""

from __future__ import annotations

import functools
import gzip
import hashlib
import json
import pathlib
import re

import numpy as np
import viser
import zstandard

_LOADER = re.compile(r'<script data-p="([^"]*)" data-ss="(\d+)" data-cs="(\d+)">(.*?)</script>', re.DOTALL)
_ALPHABET = re.compile(r'const A=("(?:[^"\\]|\\.)*");')
_DECODER = re.compile(r'gzWasm="((?:[^"\\]|\\.)*)"')

_FIRST_LIGHTS = "enableDefaultLights:!0,enableDefaultLightsShadows:!0,environmentMap:null"
_NO_LIGHTS = "enableDefaultLights:!1,enableDefaultLightsShadows:!1,environmentMap:{hdri_data:null}"
"""The state of the page before the server's first message; a message that comes later replaces it."""

_TONE_MAPPING = re.compile(r"\.toneMapping=\w\?0:4")
"""Where the program chooses a film's contrast; without it colours are those that were sent."""

_PAGE = """<!doctype html><html lang="en"><head><meta charset="utf-8"><title>ig2mj</title>
<link rel="icon" href="data:,"><meta name="viewport" content="width=device-width, initial-scale=1">
<link rel="modulepreload" href="{program}"><link rel="preload" href="{decoder}" as="fetch" crossorigin>
<link rel="stylesheet" href="{style}"><script type="module" src="{program}"></script></head>
<body><noscript>This page needs JavaScript.</noscript><div id="root"></div></body></html>"""


@functools.cache
def client_files() -> dict[str, bytes]:
    """The page's files by path, "" being the page itself.

    Raises:
      ValueError: viser's page is not built as that of the version that we were written for.
    """
    text = (pathlib.Path(viser.__file__).parent / "client/build/index.html").read_text()
    loader = _LOADER.search(text)
    if loader is None:
        raise ValueError("no loader")
    packed, style_size, program_size, code = loader.groups()
    alphabet, decoder = _ALPHABET.search(code), _DECODER.search(code)
    if alphabet is None or decoder is None:
        raise ValueError("another loader")
    letters = json.loads(alphabet[1])
    unpacked = zstandard.ZstdDecompressor().decompress(from_letters(packed, letters))
    style, program = unpacked[: int(style_size)], unpacked[int(style_size) :].decode()
    if len(unpacked) != int(style_size) + int(program_size) or program.count(_FIRST_LIGHTS) != 1:
        raise ValueError("another program")
    program, count = _TONE_MAPPING.subn(".toneMapping=0", program)
    if count != 1:
        raise ValueError("another program")
    wasm = gzip.decompress(from_letters(json.loads(f'"{decoder[1]}"'), letters))
    names = {"style": _named("viser", ".css", style), "decoder": _named("decoder", ".wasm", wasm)}
    # The program takes the decoder of the web socket's messages from where the loader would have left it.
    start = f'globalThis.__viserZstdWasm=await WebAssembly.compileStreaming(fetch("{names["decoder"]}"));'
    main = (start + program.replace(_FIRST_LIGHTS, _NO_LIGHTS)).encode()
    names["program"] = _named("viser", ".js", main)
    page = _PAGE.format(**names).encode()
    return {"": page, names["style"]: style, names["decoder"]: wasm, names["program"]: main}


def from_letters(text: str, letters: str) -> bytes:
    """Bytes that were written as text: four as five digits of base 88, the last r as r + 1."""
    table = np.zeros(128, np.uint64)
    table[[ord(letter) for letter in letters]] = np.arange(len(letters))
    digits = table[np.frombuffer(text.encode("ascii"), np.uint8)]
    whole, rest = len(digits) // 5, digits[len(digits) // 5 * 5 :]
    powers = np.array([len(letters) ** k for k in (4, 3, 2, 1, 0)], np.uint64)
    out = (digits[: 5 * whole].reshape(-1, 5) @ powers).astype(">u4").tobytes()
    value = 0
    for digit in rest.tolist():
        value = value * len(letters) + int(digit)
    return out + value.to_bytes(max(len(rest) - 1, 0), "big")


def _named(name: str, ending: str, body: bytes) -> str:
    """A name that no other content has."""
    return f"{name}-{hashlib.sha256(body).hexdigest()[:16]}{ending}"
