"""`EventFile`: curves of a run in TensorBoard's format.

The packages that write this format import PyTorch where it is installed, which takes 1 to 10 s of a run's start. Only
scalars are needed: a file is a sequence of records, each the message `Event` of TensorFlow's `event.proto` between its
length and checksums (`tensorflow/core/lib/io/record_writer.h`).
"""

from __future__ import annotations

import pathlib
import socket
import struct
import time
from collections.abc import Mapping

VERSION = "brain.Event:2"
"""The first record names it."""

_POLYNOMIAL = 0x82F63B78  # Castagnoli's, bits reversed
_MASK = 0xA282EAD8
_DOUBLE, _FLOAT, _BYTES = 1, 5, 2  # wire types of protocol buffers; 0 is a whole number


class EventFile:
    """A new file `events.out.tfevents...` in a run's folder; every row is on the disk when `add` returns."""

    def __init__(self, folder: pathlib.Path):
        """Raises OSError."""
        self._file = folder / f"events.out.tfevents.{time.time():.0f}.{socket.gethostname()}"
        self._write(_field(3, VERSION.encode()))

    def add(self, step: int, values: Mapping[str, float]) -> None:
        """One point of each curve, at this step, which is not negative."""
        points = b"".join(
            _field(1, _field(1, name.encode()) + _key(2, _FLOAT) + struct.pack("<f", value))
            for name, value in values.items()
        )
        self._write(_key(2, 0) + _varint(step) + _field(5, points))

    def _write(self, event: bytes) -> None:
        event = _key(1, _DOUBLE) + struct.pack("<d", time.time()) + event
        length = struct.pack("<Q", len(event))
        with self._file.open("ab") as file:
            file.write(length + _checksum(length) + event + _checksum(event))


def _key(field: int, wire: int) -> bytes:
    return _varint(field << 3 | wire)


def _field(number: int, content: bytes) -> bytes:
    return _key(number, _BYTES) + _varint(len(content)) + content


def _varint(number: int) -> bytes:
    found = bytearray()
    while number > 0x7F:
        found.append(number & 0x7F | 0x80)
        number >>= 7
    return bytes([*found, number])


def _row(byte: int) -> int:
    for _ in range(8):
        byte = byte >> 1 ^ (_POLYNOMIAL if byte & 1 else 0)
    return byte


_TABLE = tuple(map(_row, range(256)))


def _checksum(data: bytes) -> bytes:
    """CRC-32C, turned and shifted as records have it."""
    crc = 0xFFFFFFFF
    for byte in data:
        crc = crc >> 8 ^ _TABLE[(crc ^ byte) & 0xFF]
    crc ^= 0xFFFFFFFF
    return struct.pack("<I", ((crc >> 15 | crc << 17) + _MASK) & 0xFFFFFFFF)
