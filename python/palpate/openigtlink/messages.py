"""Messages of OpenIGTLink, versions 1 and 2: TRANSFORM, STRING, POINT.

Source: openigtlink.org, "Protocol, version 3 specification". A header of 58 bytes (version, type, device name, time
stamp, size of the body, CRC-64 of the body), then the body; all numbers are big-endian. From version 2 on an extended
header stands before the content, and meta data after it.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

HEADER = struct.Struct(">H12s20sIIQQ")
EXTENDED = struct.Struct(">HHII")
# Of what Palpate reads: a string command is the longest.
MOST_BODY_BYTES = 4096
MOST_TEXT = 1024
ASCII, UTF8 = 3, 106
POINT = struct.Struct(">64s32s4B3ff20s")
POLYNOMIAL, MASK = 0x42F0E1EBA9EA3693, 2**64 - 1


class MessageError(ValueError):
    """Bytes that are no message of OpenIGTLink, or one that is refused."""


@dataclass(frozen=True)
class Message:
    """A message that has been received: its type, the name of its device, and its content."""

    kind: str
    device: str
    content: bytes


def _crc_table() -> list[int]:
    table = []
    for byte in range(256):
        value = byte << 56
        for _ in range(8):
            value = (value << 1 ^ (POLYNOMIAL if value >> 63 else 0)) & MASK
        table.append(value)
    return table


_TABLE = _crc_table()


def crc64(data: bytes) -> int:
    """ECMA-182's polynomial, from zero, not reflected."""
    crc = 0
    for byte in data:
        crc = ((crc << 8) & MASK) ^ _TABLE[(crc >> 56) ^ byte]
    return crc


def pack(kind: str, device: str, content: bytes, time: float = 0.0) -> bytes:
    """Message of version 1 with a time stamp, s."""
    seconds = int(time)
    fraction = int((time - seconds) * 2**32)
    header = HEADER.pack(1, kind.encode(), device.encode()[:20], seconds, fraction, len(content), crc64(content))
    return header + content


def transform_content(matrix: np.ndarray) -> bytes:
    """Content of a TRANSFORM: the columns of a (4, 4) matrix, the last of them the position."""
    return np.ascontiguousarray(matrix[:3].T, dtype=">f4").tobytes()


def string_content(text: str) -> bytes:
    """Content of a STRING."""
    data = text.encode()
    return struct.pack(">HH", UTF8 if not text.isascii() else ASCII, len(data)) + data


def point_content(positions: np.ndarray, names: Sequence[str], diameters: Sequence[float]) -> bytes:
    """Content of a POINT: (k, 3) positions and diameters in the units of the wire."""
    rows = zip(positions, names, diameters, strict=True)
    return b"".join(
        POINT.pack(name.encode()[:64], b"Contact", 255, 200, 0, 255, *place, diameter, b"")
        for place, name, diameter in rows
    )


def read_transform(message: Message) -> np.ndarray:
    """Matrix (4, 4) of a TRANSFORM; MessageError for a content of another size, or numbers that are no rigid motion."""
    if len(message.content) != 48:
        raise MessageError(f"a TRANSFORM has 48 bytes, got {len(message.content)}")
    matrix = np.eye(4)
    matrix[:3] = np.frombuffer(message.content, dtype=">f4").astype(float).reshape(4, 3).T
    turned = matrix[:3, :3]
    # Single precision: a rotation is one to a millionth.
    if not np.isfinite(matrix).all() or np.abs(turned @ turned.T - np.eye(3)).max() > 1e-3 or np.linalg.det(turned) < 0:
        raise MessageError("a TRANSFORM must be a rotation and a position")
    return matrix


def read_string(message: Message) -> str:
    """Text of a STRING; MessageError for a length that is not that of the content, or a text that is no UTF-8."""
    content = message.content
    if len(content) < 4:
        raise MessageError("a STRING has an encoding and a length")
    _, length = struct.unpack_from(">HH", content)
    if length != len(content) - 4 or length > MOST_TEXT:
        raise MessageError(f"a STRING of {length} bytes comes with {len(content) - 4}")
    try:
        return content[4:].decode()
    except UnicodeDecodeError:
        raise MessageError("a STRING must be UTF-8") from None


class Reader:
    """Splits the bytes of a connection into messages; it never keeps more than one."""

    def __init__(self) -> None:
        self._bytes = bytearray()

    @property
    def is_within_message(self) -> bool:
        """Whether a message has begun and has not ended."""
        return bool(self._bytes)

    def push(self, data: bytes) -> list[Message]:
        """Take bytes up, and give the messages that have become complete.

        Raises MessageError for bytes that are no message, a body that is too long, or one whose checksum differs.
        """
        self._bytes += data
        messages = []
        while len(self._bytes) >= HEADER.size:
            version, kind, device, _, _, size, crc = HEADER.unpack_from(self._bytes)
            if not 1 <= version <= 3:
                raise MessageError(f"version {version} of OpenIGTLink is unknown")
            if size > MOST_BODY_BYTES:
                raise MessageError(f"a message of {size} bytes is refused: {MOST_BODY_BYTES} at most")
            end = HEADER.size + size
            if len(self._bytes) < end:
                break
            body = bytes(self._bytes[HEADER.size : end])
            del self._bytes[:end]
            if crc != crc64(body):
                raise MessageError("the checksum of a message differs")
            messages.append(Message(_name(kind), _name(device), body if version == 1 else _content(body)))
        return messages


def _name(data: bytes) -> str:
    return data.split(b"\0", 1)[0].decode("ascii", errors="replace")


def _content(body: bytes) -> bytes:
    """Content between extended header and meta data."""
    if len(body) < EXTENDED.size:
        raise MessageError("an extended header is cut short")
    size, table, meta, _ = EXTENDED.unpack_from(body)
    end = len(body) - table - meta
    if not EXTENDED.size <= size <= end:
        raise MessageError("an extended header does not fit its message")
    return body[size:end]
