"""Messages of the viewer: text is JSON; binary is a JSON header and the arrays that it describes.

A binary message is ``uint32`` header length, the header in UTF-8 padded with spaces so that the arrays start at a
multiple of 8 bytes, then the arrays, little-endian, each at the offset after the header that its entry names. An array
of one body is named ``<index of the body>/<what it is>`` and stands in the frame of that body, one of a tool
``tools/<index of the tool>/<what it is>``; poses of tools, forces and what clients send stand in that of the scene.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from palpate.errors import ViewerError
from palpate.units import to_float
from palpate.vectors import three_numbers

VERSION = 12
# Longest name in a client's message.
LONGEST_WORD = 40
DTYPES = {kind: np.dtype(f"<{kind}") for kind in ("f4", "u4", "u1")}


def encode(header: Mapping[str, Any], arrays: Mapping[str, tuple[str, np.ndarray]]) -> bytes:
    """Binary message; ``arrays`` maps a name to (dtype name, array)."""
    entries, blocks, offset = [], [], 0
    for name, (dtype, array) in arrays.items():
        data = np.ascontiguousarray(array, dtype=DTYPES[dtype])
        entries.append({"name": name, "dtype": dtype, "shape": list(data.shape), "offset": offset})
        padding = -data.nbytes % 8
        blocks.append(data.tobytes() + b"\0" * padding)
        offset += data.nbytes + padding
    text = json.dumps({**header, "arrays": entries}, separators=(",", ":"), allow_nan=False).encode()
    text += b" " * (-(4 + len(text)) % 8)
    return b"".join([struct.pack("<I", len(text)), text, *blocks])


def decode(message: bytes) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Header and arrays of a binary message, for programs other than the page."""
    (length,) = struct.unpack_from("<I", message)
    header = json.loads(message[4 : 4 + length])
    arrays = {}
    for entry in header["arrays"]:
        count = int(np.prod(entry["shape"]))
        data = np.frombuffer(message, DTYPES[entry["dtype"]], count, 4 + length + entry["offset"])
        arrays[entry["name"]] = data.reshape(entry["shape"])
    return header, arrays


def parse(text: str | bytes) -> dict[str, Any]:
    """Read a client's message: a JSON object with a type; ViewerError for anything else."""
    if isinstance(text, bytes):
        raise ViewerError("a client sends text messages only")
    try:
        message = json.loads(text, parse_constant=_refuse)
    except (ValueError, RecursionError):
        raise ViewerError("a message is not JSON") from None
    if not isinstance(message, dict) or not isinstance(message.get("type"), str):
        raise ViewerError("a message is not an object with a type")
    return message


def number(message: Mapping[str, Any], key: str) -> float:
    """Take a finite number of a client's message."""
    value = message.get(key)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not np.isfinite(to_float(value)):
        raise ViewerError(f"{message['type']}: {key} must be a finite number")
    return float(value)


def positive_or_none(message: Mapping[str, Any], key: str) -> float | None:
    """Take a positive number of a client's message; None where it gives none, or null."""
    if message.get(key) is None:
        return None
    value = number(message, key)
    if value <= 0.0:
        raise ViewerError(f"{message['type']}: {key} must be a positive number")
    return value


def flag(message: Mapping[str, Any], key: str) -> bool:
    """Take true or false of a client's message."""
    value = message.get(key)
    if not isinstance(value, bool):
        raise ViewerError(f"{message['type']}: {key} must be true or false")
    return value


def whole(message: Mapping[str, Any], key: str, low: int, high: int) -> int:
    """Take a whole number within bounds of a client's message."""
    value = message.get(key)
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise ViewerError(f"{message['type']}: {key} must be a whole number from {low} to {high}")
    return value


def index(message: Mapping[str, Any], key: str, count: int) -> int:
    """Take the index of one of ``count`` things of a client's message."""
    return whole(message, key, 0, count - 1)


def vector(message: Mapping[str, Any], key: str) -> tuple[float, float, float]:
    """Three finite numbers of a client's message."""
    return three_numbers(message.get(key), f"{message['type']}: {key}", ViewerError)


def quaternion(message: Mapping[str, Any], key: str) -> tuple[float, float, float, float]:
    """Four finite numbers of a client's message; whether they are an orientation is asked where they are used."""
    value, what = message.get(key), f"{message['type']}: {key}"
    if not isinstance(value, list) or len(value) != 4:
        raise ViewerError(f"{what} needs four numbers")
    return (number({**message, key: value[0]}, key), *three_numbers(value[1:], what, ViewerError))


def numbered(
    arrays: Sequence[Mapping[str, tuple[str, np.ndarray]]], prefix: str = ""
) -> dict[str, tuple[str, np.ndarray]]:
    """Arrays of several bodies, or with the prefix ``tools/`` of tools, under the names they have in a message."""
    return {f"{prefix}{rank}/{name}": array for rank, own_type in enumerate(arrays) for name, array in own_type.items()}


def word(message: Mapping[str, Any], key: str) -> str:
    """Take a short text of a client's message."""
    value = message.get(key)
    if not isinstance(value, str) or len(value) > LONGEST_WORD:
        raise ViewerError(f"{message['type']}: {key} must be a name")
    return value


def _refuse(name: str) -> float:
    raise ValueError(name)
