"""Binary messages with fixed content, which the tests of both sides decode.

``tests/data/golden_<kind>.json`` says what a message holds, ``tests/data/golden_<kind>.bin`` is that message. Run this
file to write the messages anew, after a change of the protocol.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from palpate.viewer import messages

DATA = Path(__file__).parents[1] / "data"
KINDS = ("scene", "frame")


def content(kind: str) -> tuple[dict, dict[str, tuple[str, np.ndarray]]]:
    """Header and arrays of a message, as the JSON file has them; values are such that they survive ``float32``."""
    data = json.loads((DATA / f"golden_{kind}.json").read_text())
    arrays = {
        name: (entry["dtype"], np.array(entry["values"]).reshape(entry["shape"]))
        for name, entry in data["arrays"].items()
    }
    return data["header"], arrays


def stored(kind: str) -> bytes:
    """The message itself."""
    return (DATA / f"golden_{kind}.bin").read_bytes()


if __name__ == "__main__":
    for kind in KINDS:
        (DATA / f"golden_{kind}.bin").write_bytes(messages.encode(*content(kind)))
