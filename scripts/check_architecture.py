"""Check that ARCHITECTURE.md is true: its folders exist, its dependency rules hold, files stay readable."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import tomllib

ROOT = Path(__file__).resolve().parent.parent
MAX_FILE_LINES = 500
MAX_PAGE_LINES = 100

# What each crate must not depend on, and why.
FORBIDDEN = {
    "core": (
        {"pyo3", "numpy", "triple_buffer", "rtrb", "libc"},
        "core knows no Python, no clock and no hand-off",
    ),
    "devices": ({"pyo3", "numpy", "palpate-servo"}, "a driver knows poses and wrenches only"),
    "servo": ({"pyo3", "numpy"}, "the loop runs without Python"),
}


def main() -> int:
    """Print every broken rule; the exit status is 1 if there is one."""
    problems = [*page_problems(), *dependency_problems(), *length_problems()]
    for problem in problems:
        print(f"check_architecture: {problem}", file=sys.stderr)
    return 1 if problems else 0


def page_problems() -> list[str]:
    """Folders that the page names and nobody has."""
    page = (ROOT / "ARCHITECTURE.md").read_text()
    problems = []
    if len(page.splitlines()) > MAX_PAGE_LINES:
        problems.append(f"ARCHITECTURE.md is longer than {MAX_PAGE_LINES} lines")
    for name in re.findall(r"`([\w./-]+/)`", page):
        if not (ROOT / name).is_dir():
            problems.append(f"ARCHITECTURE.md names the folder {name}, which does not exist")
    chapters = [
        *ROOT.glob("crates/*"),
        *ROOT.glob("crates/core/src/*"),
        *ROOT.glob("python/palpate/*"),
        *ROOT.glob("*"),
    ]
    kept = {name.rpartition("/")[0] for name in tracked_files()}
    for folder in sorted(p.relative_to(ROOT).as_posix() for p in chapters if p.is_dir()):
        tracked = any(name == folder or name.startswith(f"{folder}/") for name in kept)
        if tracked and not folder.startswith(".") and f"`{folder}/" not in page:
            problems.append(f"ARCHITECTURE.md does not mention {folder}/")
    return problems


def tracked_files() -> list[str]:
    """Files that the repository keeps; all of them outside of a repository."""
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True)
    if listed.returncode:
        return [p.relative_to(ROOT).as_posix() for p in ROOT.rglob("*") if p.is_file()]
    return listed.stdout.splitlines()


# All that a driver may know of the core.
DEVICE_TYPES = {"Pose", "Twist", "Wrench"}


def device_problems() -> list[str]:
    """Find uses of the core by drivers that go beyond the types of the trait."""
    problems = []
    for path in sorted((ROOT / "crates/devices").rglob("*.rs")):
        uses = re.sub(r"//.*", "", path.read_text())
        allowed = re.sub(r"\bpalpate_core::simulation::(\w+|\{[\w\s,]*\})", allowed_types, uses)
        if "palpate_core" in allowed:
            names = ", ".join(sorted(DEVICE_TYPES))
            problems.append(f"{path.relative_to(ROOT)} uses more of the core than {names}: a driver knows no bodies")
    return problems


def allowed_types(use: re.Match[str]) -> str:
    """Leave nothing of a use of the core that names types of the trait only."""
    names = set(re.findall(r"\w+", use[1]))
    return "" if names <= DEVICE_TYPES else use[0]


def dependency_problems() -> list[str]:
    """Dependencies that a crate's place forbids."""
    problems = device_problems()
    for crate, (forbidden, reason) in FORBIDDEN.items():
        manifest = ROOT / "crates" / crate / "Cargo.toml"
        if manifest.exists():
            used = set(tomllib.loads(manifest.read_text()).get("dependencies", {}))
            problems += [f"crates/{crate} must not depend on {name}: {reason}" for name in sorted(used & forbidden)]
    core = "\n".join(p.read_text() for p in (ROOT / "crates/core/src").rglob("*.rs"))
    problems += [
        f"crates/core uses {name}: it reads no clock" for name in ("Instant::now", "SystemTime") if name in core
    ]
    return problems


def length_problems() -> list[str]:
    """Source files too long to be read in one go."""
    patterns = ("crates/*/src/**/*.rs", "python/**/*.py", "tests/**/*.py", "viewer/src/**/*.ts")
    sources = [p for pattern in patterns for p in ROOT.glob(pattern)]
    return [
        f"{p.relative_to(ROOT)} has more than {MAX_FILE_LINES} lines"
        for p in sources
        if len(p.read_text().splitlines()) > MAX_FILE_LINES
    ]


if __name__ == "__main__":
    sys.exit(main())
