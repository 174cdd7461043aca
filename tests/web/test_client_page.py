"""viser's page, unpacked beforehand: what a browser would unpack, without the lights that no home of ours has."""

from __future__ import annotations

import pathlib

import pytest

pytest.importorskip("viser")

import viser

from ig2mj.web.client_page import client_files, from_letters

LETTERS = "".join(chr(c) for c in range(0x21, 0x7F) if chr(c) not in "\"&<>'`")


@pytest.mark.parametrize("size", range(9))
def test_letters_give_the_bytes_back(size):
    body = bytes(range(250, 250 - size, -1))
    text = ""
    for start in range(0, size, 4):
        part = body[start : start + 4]
        value, digits = int.from_bytes(part, "big"), []
        for _ in range(len(part) + 1):
            value, digit = divmod(value, 88)
            digits.append(LETTERS[digit])
        text += "".join(reversed(digits))
    assert from_letters(text, LETTERS) == body


def test_the_page_is_three_files_that_browsers_may_keep():
    files = client_files()
    page = files[""].decode()
    named = [name for name in files if name]
    assert sorted(name.rpartition(".")[2] for name in named) == ["css", "js", "wasm"]
    assert all(name in page or name.endswith(".wasm") for name in named)
    program = next(body for name, body in files.items() if name.endswith(".js")).decode()
    assert len(program) > 10**6 and program.count(f"`{viser.__version__}`") > 0
    assert next(body for name, body in files.items() if name.endswith(".wasm")).startswith(b"\0asm")


def test_the_program_begins_without_lights_of_its_own():
    program = next(body for name, body in client_files().items() if name.endswith(".js")).decode()
    assert "enableDefaultLights:!0" not in program and "environmentMap:null" not in program


def test_another_page_of_visers_is_not_taken_for_ours(tmp_path, monkeypatch):
    built = tmp_path / "client/build"
    built.mkdir(parents=True)
    (built / "index.html").write_text("<html><script>1</script></html>")
    monkeypatch.setattr(viser, "__file__", str(pathlib.Path(tmp_path / "__init__.py")))
    with pytest.raises(ValueError, match="no loader"):
        client_files.__wrapped__()
