"""Check a built wheel: its size and its program's, its tags, its version, and that the page of the viewer is inside.

Usage: check_wheel.py [FOLDER or WHEEL]; of a folder the newest wheel is taken, default: dist.
"""

from __future__ import annotations

import re
import subprocess
import sys
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
# Size that a wheel may have, bytes: as much as a person waits for without noticing.
LARGEST = 15_000_000
# The same of the program of pages without a server, which every visitor fetches.
LARGEST_PROGRAM = 2_500_000
PAGE = "palpate/viewer/static/index.html"
PROGRAM = "palpate/viewer/web/palpate.wasm"
WIDGET = "palpate/viewer/widget.mjs"


def main() -> int:
    """Print what the wheel is, and one line for each fault."""
    wheel = newest(Path(sys.argv[1] if len(sys.argv) > 1 else "dist"))
    print(f"{wheel.name}: {wheel.stat().st_size / 1e6:.1f} MB")
    if "linux" in wheel.name:
        subprocess.run([sys.executable, "-m", "auditwheel", "show", str(wheel)], check=True)
    faults = problems(wheel)
    for fault in faults:
        print(f"{wheel.name} {fault}", file=sys.stderr)
    return 1 if faults else 0


def newest(where: Path) -> Path:
    """Take the wheel itself, or the newest one of a folder."""
    if where.suffix == ".whl":
        return where
    wheels = sorted(where.glob("*.whl"), key=lambda wheel: wheel.stat().st_mtime)
    if not wheels:
        sys.exit(f"{where} has no wheel: 'make wheel' builds one")
    return wheels[-1]


def problems(wheel: Path) -> list[str]:
    """Say what keeps the wheel from being handed out."""
    found = []
    size = wheel.stat().st_size
    if size > LARGEST:
        found.append(f"has {size / 1e6:.1f} MB, at most {LARGEST / 1e6:.0f} MB are allowed")
    version, _, abi = wheel.stem.split("-")[1:4]
    if version != workspace_version():
        found.append(f"has version {version}, Cargo.toml has {workspace_version()}")
    if abi != "abi3":
        found.append(f"is for one Python only ({abi}, not abi3)")
    with zipfile.ZipFile(wheel) as contents:
        names = contents.namelist()
        program = contents.getinfo(PROGRAM).file_size if PROGRAM in names else 0
    if program > LARGEST_PROGRAM:
        found.append(f"has a program of {program / 1e6:.1f} MB, at most {LARGEST_PROGRAM / 1e6:.1f} MB are allowed")
    if PAGE not in names:
        found.append("has no page: 'make viewer' builds it")
    if PROGRAM not in names:
        found.append("has no program for pages without a server: 'make web' builds it")
    if WIDGET not in names:
        found.append("has no script for widgets in notebooks")
    if not any("/licenses/" in name and name.endswith("THIRD-PARTY.md") for name in names):
        found.append("does not name the work of others (THIRD-PARTY.md)")
    foreign = sorted(name for name in names if not re.match(r"palpate(-[^/]*\.dist-info)?/", name))
    if foreign:
        found.append(f"has files outside the package: {', '.join(foreign[:3])}")
    return found


def workspace_version() -> str:
    """Read the version, which stands in Cargo.toml alone."""
    found = re.search(r'^version = "(.*)"', (ROOT / "Cargo.toml").read_text(), re.MULTILINE)
    assert found is not None, "Cargo.toml has no version"
    return found[1]


if __name__ == "__main__":
    sys.exit(main())
