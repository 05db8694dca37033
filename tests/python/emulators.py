"""Emulated devices: the service and the libraries that tests let the command line find."""

from __future__ import annotations

import os
import re
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]

# The way of the hand that holds a device: 8 mm below the middle of its workspace and up again, every second.
PRESS = "0 0 0 5; 0.5 0 0 -8; 1 0 0 5"
# Held loosely in one place.
REST = "0 0 0 0"


@cache
def built() -> Path:
    """Folder with the service and the libraries.

    They are built as for the tests of the drivers. Built by themselves they would ask for fewer features of their
    dependencies, and cargo would compile most of what it has for `cargo test` again.
    """
    command = ["cargo", "test", "--release", "--quiet", "--workspace", "--test", "conformance", "--no-run"]
    subprocess.run(command, cwd=ROOT, check=True, timeout=600)
    return Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "release"


def library(name: str) -> str:
    """File of an emulated library, such as ``"hd"``."""
    found = [*(built() / "deps").glob(f"libpalpate_emulated_{name}.*")]
    return str(next(file for file in found if file.suffix in (".so", ".dylib")))


@contextmanager
def inverse_service(hand: str = PRESS) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """Address and process of a service with an arm in a hand."""
    command = [str(built() / "inverse-service"), "--port", "0", "--events-port", "0"]
    environment = {**os.environ, "PALPATE_EMULATED_HAND": hand}
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        address = re.search(r"ws://\S+", line)
        assert address, line
        try:
            yield address[0], process
        finally:
            process.kill()
