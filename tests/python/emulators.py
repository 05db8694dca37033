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


@cache
def built() -> Path:
    """Folder with the service and the libraries; built once, of what the tests of the drivers have compiled."""
    packages = ("palpate-emulators", "palpate-emulated-openhaptics", "palpate-emulated-forcedimension")
    options = [option for package in packages for option in ("-p", package)]
    subprocess.run(["cargo", "build", "--release", "--quiet", *options], cwd=ROOT, check=True, timeout=600)
    return Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "release"


def library(name: str) -> str:
    """File of an emulated library, such as ``"hd"``."""
    found = [*built().glob(f"libpalpate_emulated_{name}.*")]
    return str(next(file for file in found if file.suffix in (".so", ".dylib", ".dll")))


@contextmanager
def inverse_service(*options: str) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """Address and process of a service that runs."""
    program = built() / "inverse-service"
    command = [str(program), "--port", "0", "--events-port", "0", *options]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        address = re.search(r"ws://\S+", line)
        assert address, line
        try:
            yield address[0], process
        finally:
            process.kill()
