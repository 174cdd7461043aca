"""Archives of arrays: nothing is unpacked before its declared size is believed."""

from __future__ import annotations

import io
import struct
import zipfile
import zlib

import numpy as np
import pytest
from limits import run_limited

from ig2mj.errors import Ig2mjError, InputError
from ig2mj.files.npz import read_npz, write_npz


def packed(**arrays: np.ndarray) -> bytes:
    out = io.BytesIO()
    np.savez_compressed(out, **arrays)  # pyright: ignore[reportArgumentType]
    return out.getvalue()


def archive(**entries: bytes) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as made:
        for name, content in entries.items():
            made.writestr(f"{name}.npy", content)
    return out.getvalue()


def header(shape: str, kind: str = "<f4") -> bytes:
    text = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}".ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text.encode()


def zeros(gigabytes: int) -> bytes:
    """An archive with one array of so many GB, made without ever holding them; its checksum is wrong."""
    size, block, checksum = gigabytes * 10**9, bytes(10**7), 0
    out, packer = io.BytesIO(), zlib.compressobj(9, zlib.DEFLATED, -15)
    content = packer.compress(header(f"({size},)", "|u1")) + packer.flush(zlib.Z_FULL_FLUSH)
    content += (packer.compress(block) + packer.flush(zlib.Z_FULL_FLUSH)) * (size // len(block)) + packer.flush()
    whole = size + len(header(f"({size},)", "|u1"))
    name = b"a.npy"
    sizes = struct.pack("<LLL", checksum, len(content), whole)
    out.write(b"PK\3\4" + struct.pack("<HHHHH", 20, 0, 8, 0, 0) + sizes + struct.pack("<HH", 5, 0) + name + content)
    start = out.tell()
    out.write(b"PK\1\2" + struct.pack("<HHHHHH", 20, 20, 0, 8, 0, 0) + sizes)
    out.write(struct.pack("<HHHHHLL", 5, 0, 0, 0, 0, 0, 0) + name)
    out.write(b"PK\5\6" + struct.pack("<HHHHLLH", 0, 0, 1, 1, out.tell() - start, start, 0))
    return out.getvalue()


def test_arrays_come_out_as_they_were_saved(tmp_path):
    made = {
        "a": np.arange(6.0).reshape(2, 3),
        "columns": np.asfortranarray(np.arange(6).reshape(2, 3)),
        "text": np.array(["kitchen_0", "ü"]),
        "none": np.zeros((0, 4), np.float32),
        "one": np.array(True),
        "big_endian": np.arange(3, dtype=">i4"),
        "half": np.ones(3, np.float16),
    }
    file = tmp_path / "a.npz"
    file.write_bytes(packed(**made))
    for found in (read_npz(file), read_npz(file.read_bytes())):
        assert list(found) == list(made)
        for name, array in made.items():
            np.testing.assert_array_equal(found[name], array)
            assert found[name].dtype == array.dtype.newbyteorder("=")
            assert found[name].flags.writeable


def test_only_wanted_arrays_are_read_and_count(monkeypatch):
    monkeypatch.setenv("IG2MJ_LIMIT_UNPACKED_BYTES", "1000")
    raw = packed(small=np.zeros(9), large=np.zeros(9999))
    assert list(read_npz(raw, lambda name: name == "small")) == ["small"]
    with pytest.raises(InputError, match="IG2MJ_LIMIT_UNPACKED_BYTES raises it"):
        read_npz(raw)


def read_zeros(gigabytes: int) -> None:
    read_npz(zeros(gigabytes))


def test_a_small_file_of_gigabytes_is_refused_before_they_are_unpacked():
    outcome = run_limited(read_zeros, 3).check(InputError, "claims arrays of 3000000128 bytes .*UNPACKED_RATIO=")
    assert outcome.memory < 300 * 2**20


def test_a_shape_that_the_archive_does_not_have_is_refused():
    for shape in ("(1000000000000,)", "(-1, 4)", "(2,)", "(4, 4611686018427387904)", "(True,)", "()" * 50):
        with pytest.raises(InputError, match="a"):
            read_npz(archive(a=header(shape) + bytes(4)))


def huge_directory() -> None:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as made:
        for k in range(60_000):
            made.writestr(f"{k:060}.npy", b"")
    read_npz(out.getvalue())


def test_a_directory_of_too_many_arrays_is_refused():
    run_limited(huge_directory).check(InputError, "has a directory of|holds 60000 arrays")


@pytest.mark.parametrize(
    "raw, match",
    [
        (b"", "cut off"),
        (b"no archive", "cut off"),
        (archive(a=b"no array"), "a: is damaged"),
        (archive(a=header("(2,)", "|O") + bytes(16)), "not of numbers or text"),
        (archive(a=header("(1,)", "[('x', '<f4')]").replace(b"'[", b"[").replace(b"]'", b"]")), "a: "),
        (archive(a=header("(1,)", "|b1") + b"\7"), "neither true nor false"),
        (archive(a=header("(1,)", "<U1") + b"\xff" * 4), "letters that do not exist"),
        (archive(a=header("(1,)", "<U1") + struct.pack("<L", 0xD800)), "letters that do not exist"),
        (packed(a=np.arange(999))[:-90], "npz"),
    ],
)
def test_what_is_no_array_is_named(raw, match, tmp_path):
    file = tmp_path / "broken.npz"
    file.write_bytes(raw)
    with pytest.raises(InputError, match=match) as caught:
        read_npz(file)
    assert str(file) in str(caught.value)


def test_a_changed_byte_of_the_content_does_not_pass():
    raw = bytearray(packed(a=np.random.default_rng(0).random(1000)))
    raw[4000] ^= 1
    with pytest.raises(InputError, match="a: is damaged"):
        read_npz(bytes(raw))


def test_two_arrays_of_one_name_are_refused():
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as made, pytest.warns(UserWarning):
        made.writestr("a.npy", header("(1,)") + bytes(4))
        made.writestr("a.npy", header("(1,)") + bytes(4))
    with pytest.raises(InputError, match="two arrays of one name"):
        read_npz(out.getvalue())


def test_a_device_and_a_folder_are_no_files(tmp_path):
    for place in ("/dev/zero", tmp_path):
        with pytest.raises(InputError, match="is a folder or a device"):
            read_npz(place)


def test_a_limit_that_is_no_number_is_named(monkeypatch):
    monkeypatch.setenv("IG2MJ_LIMIT_SMALL_BYTES", "much")
    with pytest.raises(Ig2mjError, match="IG2MJ_LIMIT_SMALL_BYTES=much: must be a whole number"):
        read_npz(packed(a=np.zeros(3)))


@pytest.mark.parametrize("sizes", [(200_000, 900, 3_000), (50_000, 50_000, 1_100), (5_000,) * 40, ()])
def test_rows_that_are_all_alike_are_written_as_they_can_be_read(sizes, monkeypatch):
    """4,096 start states that differ in a few numbers pack 325 to 1: more than a stranger's file may."""
    monkeypatch.setenv("IG2MJ_LIMIT_SMALL_BYTES", "10000")
    arrays = {f"a{k}": np.full(size, k, np.float32) for k, size in enumerate(sizes)}
    out = io.BytesIO()
    write_npz(out, arrays)
    back = read_npz(out.getvalue())
    assert list(back) == list(arrays) and all((back[name] == arrays[name]).all() for name in arrays)
    assert len(out.getvalue()) < 0.15 * sum(4 * size for size in sizes) + 20_000
    if max(sizes, default=0) >= 50_000:
        with pytest.raises(InputError, match="claims arrays of"):
            read_npz(packed(**arrays))


def test_what_packs_as_others_do_is_written_as_numpy_writes_it_without_its_64_bit_sizes():
    """NumPy keeps room for them before every array: 20 bytes."""
    arrays = {"a": np.arange(999.0), "b": np.zeros((3, 4), bool), "c": np.array("text")}
    out, usual = io.BytesIO(), packed(**arrays)
    write_npz(out, arrays)
    assert len(out.getvalue()) == len(usual) - 20 * len(arrays)
    with zipfile.ZipFile(out) as ours, zipfile.ZipFile(io.BytesIO(usual)) as theirs:
        assert [(e.filename, e.CRC, e.compress_size) for e in ours.infolist()] == [
            (e.filename, e.CRC, e.compress_size) for e in theirs.infolist()
        ]


def test_an_array_beyond_32_bits_is_written_with_64_bit_sizes(monkeypatch):
    monkeypatch.setattr(zipfile, "ZIP64_LIMIT", 2**20)
    large = np.random.default_rng(0).integers(0, 256, 2**20 + 1, np.uint8)
    out = io.BytesIO()
    write_npz(out, {"large": large, "small": np.zeros(3)})
    assert (read_npz(out.getvalue())["large"] == large).all()
