"""HDF5: only what is in the file, of the size that it claims."""

from __future__ import annotations

import zlib

import h5py
import numpy as np
import pytest
from limits import run_limited

from ig2mj.errors import InputError
from ig2mj.files.hdf5 import Hdf5File


@pytest.fixture
def secret(tmp_path):
    """Another file, that must not be read."""
    file = tmp_path / "secret.h5"
    with h5py.File(file, "w") as out:
        out["a"] = np.arange(4.0)
    return file


def test_arrays_and_attributes_come_out_as_they_were_written(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as out:
        out["plain"] = np.arange(6.0).reshape(2, 3)
        out.create_dataset("packed", data=np.arange(999), compression="gzip", shuffle=True, fletcher32=True)
        out.create_dataset("fast", data=np.arange(999), compression="lzf")
        out.create_dataset("growing", data=np.arange(9), maxshape=(None,))
        out.create_dataset("none", (0, 3), "f4", maxshape=(None, 3))
        out["group/flag"] = np.array([True, False])
        out["group"].attrs["text"] = "ü"
        out["group"].attrs["number"] = 3
        out["group"].attrs["flag"] = True
        out["group"].attrs["pairs"] = np.array([[1, 2]])
    with Hdf5File(tmp_path / "a.h5") as file:
        assert file.names() == ["fast", "group", "growing", "none", "packed", "plain"]
        np.testing.assert_array_equal(file.read("plain", kinds="f", ndim=2), np.arange(6.0).reshape(2, 3))
        for name, count in (("packed", 999), ("fast", 999), ("growing", 9)):
            np.testing.assert_array_equal(file.read(name), np.arange(count))
        assert file.read("none").shape == (0, 3)
        assert file.read("group/flag").tolist() == [True, False]
        found = file.attributes("group")
        assert (found["text"], found["number"], found["flag"]) == ("ü", 3, True)
        assert found["pairs"].tolist() == [[1, 2]]
        assert file.arrays_below("group") == ["group/flag"]


def test_links_out_of_the_file_are_not_followed(tmp_path, secret):
    with h5py.File(tmp_path / "a.h5", "w") as out:
        out["external"] = h5py.ExternalLink(str(secret), "/a")
        out["group"] = h5py.ExternalLink(str(secret), "/")
        out["soft"] = h5py.SoftLink("/external")
    with Hdf5File(tmp_path / "a.h5") as file:
        for name in ("external", "soft", "group/a"):
            assert not file.has(name)
            with pytest.raises(InputError, match=f"{name}: is missing, or no array of this file"):
                file.read(name)
        with pytest.raises(InputError, match="no group of this file"):
            file.names("group")


def test_arrays_that_lie_in_other_files_are_not_read(tmp_path, secret):
    raw = tmp_path / "secret.raw"
    raw.write_bytes(np.arange(4.0).tobytes())
    with h5py.File(tmp_path / "a.h5", "w") as out:
        out.create_dataset("stored", (4,), "f8", external=[(str(raw), 0, 32)])
        layout = h5py.VirtualLayout((4,), "f8")
        layout[:] = h5py.VirtualSource(str(secret), "a", shape=(4,))
        out.create_virtual_dataset("virtual", layout)
    with Hdf5File(tmp_path / "a.h5") as file:
        for name in ("stored", "virtual"):
            with pytest.raises(InputError, match=f"{name}: lies in another file"):
                file.read(name)


def read_all(file: str, name: str) -> None:
    with Hdf5File(file) as opened:
        opened.read(name)


def test_gigabytes_in_few_bytes_are_refused(tmp_path):
    """Chunks that are never written, chunks that pack well, and many arrays that are each small enough."""
    with h5py.File(tmp_path / "a.h5", "w") as out:
        out.create_dataset("claimed", (10**9,), "f8", chunks=(10**5,), compression="gzip")
        packed = out.create_dataset("packed", (4000, 2**20), "u1", chunks=(1, 2**20), compression="gzip")
        chunk = zlib.compress(bytes(2**20), 9)
        for row in range(4000):
            packed.id.write_direct_chunk((row, 0), chunk)
        out.create_dataset("wide", (4, 2**30), "u1", chunks=(1, 2**28), compression="gzip")
    run_limited(read_all, str(tmp_path / "a.h5"), "claimed").check(InputError, "rows that are not there")
    run_limited(read_all, str(tmp_path / "a.h5"), "packed").check(InputError, "claims arrays of 4194304000 bytes")
    run_limited(read_all, str(tmp_path / "a.h5"), "wide").check(InputError, "has chunks of 268435456 bytes")


def test_a_chunk_that_unpacks_to_more_than_it_should_is_refused(tmp_path):
    """HDF5 unpacks until the packed data ends, however small the chunk should be."""
    packer, full = zlib.compressobj(9), zlib.Z_FULL_FLUSH
    first, later = (packer.compress(bytes(2**24)) + packer.flush(full) for _ in range(2))
    bomb = first + later * 150 + packer.flush()
    with h5py.File(tmp_path / "a.h5", "w") as out:
        array = out.create_dataset("a", (2**22,), "u1", chunks=(2**22,), compression="gzip")
        array.id.write_direct_chunk((0,), bomb)
        small = out.create_dataset("small", (1000,), "u1", chunks=(1000,), compression="gzip")
        small.id.write_direct_chunk((0,), bomb)
    for name in ("a", "small"):
        run_limited(read_all, str(tmp_path / "a.h5"), name).check(InputError, "unpacks to more than it should")


def test_arrays_of_other_kinds_are_refused(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as out:
        out["text"] = ["a", "b"]
        out["pairs"] = np.zeros(3, [("x", "f4"), ("y", "f4")])
        out["scalar"] = 1.0
        out["scaled"] = out.create_dataset("s", data=np.arange(99), chunks=(9,), scaleoffset=0)
    with Hdf5File(tmp_path / "a.h5") as file:
        for name, match in (("text", "type object"), ("pairs", "type"), ("scalar", "0 axes"), ("scaled", "packed in")):
            with pytest.raises(InputError, match=f"{name}: .*{match}"):
                file.read(name)


def test_attributes_of_other_kinds_are_refused(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w", libver="latest") as out:
        out.create_group("long").attrs["a"] = np.zeros(2**22)
        out.create_group("reference").attrs["a"] = out["long"].ref
        out.create_group("texts").attrs["a"] = ["a"] * 9
        out.create_group("bytes").attrs["a"] = np.bytes_(b"\xff\xfe")
    with Hdf5File(tmp_path / "a.h5") as file:
        for name in file.names():
            with pytest.raises(InputError, match=f"{name}: attribute 'a'"):
                file.attributes(name)


def test_circles_of_hard_links_end(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as out:
        out["group/a"] = np.zeros(3)
        out["group/again"] = out["group"]
    with Hdf5File(tmp_path / "a.h5") as file:
        assert len(file.arrays_below("group")) == 5


def test_what_is_no_hdf5_file_is_named(tmp_path):
    (tmp_path / "a.h5").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(600))
    with pytest.raises(InputError, match=r"a\.h5: is not an HDF5 file"):
        Hdf5File(tmp_path / "a.h5")
    with pytest.raises(InputError, match="there is no such file"):
        Hdf5File(tmp_path / "b.h5")


def test_an_array_of_a_type_that_numpy_does_not_know_is_named(tmp_path):
    kind = h5py.h5t.IEEE_F32LE.copy()
    kind.set_fields(31, 23, 8, 0, 23)
    kind.set_ebias(2**20)
    with h5py.File(tmp_path / "a.h5", "w") as out:
        h5py.h5d.create(out.id, b"a", kind, h5py.h5s.create_simple((3,)))
    with Hdf5File(tmp_path / "a.h5") as file:
        for use in (lambda: file.claim(["a"]), lambda: file.read("a")):
            with pytest.raises(InputError, match=r"a: .*Insufficient precision"):
                use()


@pytest.mark.parametrize("link", [h5py.SoftLink("/other"), h5py.ExternalLink("secret.h5", "/a")])
def test_groups_are_copied_only_with_what_is_in_their_own_file(tmp_path, link):
    with h5py.File(tmp_path / "a.h5", "w") as out:
        out["good/x/y"], out["good"].attrs["n"] = np.arange(5), 3
        out["bad/x"] = np.arange(5)
        out["bad/link"] = link
        out["deep/1/2/3/4/5/6"] = np.arange(2)
    with Hdf5File(tmp_path / "a.h5") as file, h5py.File(tmp_path / "b.h5", "w") as into:
        file.copy("good", into, "run")
        assert into["run/x/y"][:].tolist() == [0, 1, 2, 3, 4] and into["run"].attrs["n"] == 3
        with pytest.raises(InputError, match="bad/link: is missing, or no array of this file"):
            file.copy("bad", into)
        with pytest.raises(InputError, match="deep/1/2/3/4/5: is a group in too many others"):
            file.copy("deep", into)
        assert list(into) == ["run"]
