"""Check a built site: the sizes of its program, of each scene and of all, and that every link leads somewhere.

Usage: check_site.py FOLDER
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

# Bytes: of page and WebAssembly together, of a scene, and of a gallery.
LARGEST_PROGRAM, LARGEST_SCENE, LARGEST_SITE = 3_000_000, 27_000_000, 100_000_000


def main() -> int:
    """Print the sizes, and one line for each fault."""
    if len(sys.argv) != 2:
        sys.exit("usage: check_site.py FOLDER")
    folder = Path(sys.argv[1])
    if not (folder / "palpate.wasm").is_file():
        sys.exit(f"{folder} has no palpate.wasm: 'palpate web' writes a site")
    scenes, program, total = sizes(folder)
    for name, size in scenes.items():
        print(f"{name}: {size / 1e6:.1f} MB")
    print(f"program {program / 1e6:.2f} MB, {len(scenes)} scenes, in all {total / 1e6:.1f} MB")
    faults = problems(folder)
    for fault in faults:
        print(f"{folder}: {fault}", file=sys.stderr)
    return 1 if faults else 0


def sizes(folder: Path) -> tuple[dict[str, int], int, int]:
    """Bytes of each scene by its name, of page and WebAssembly, and of all files."""
    files = {path: path.stat().st_size for path in folder.rglob("*") if path.is_file()}
    scenes = {path.stem: size for path, size in sorted(files.items()) if path.parent.name == "scenes"}
    shared = (size for path, size in files.items() if path.parent.name not in {"scenes", "pictures"})
    return scenes, sum(shared), sum(files.values())


def problems(folder: Path) -> list[str]:
    """Say what keeps the site from being published."""
    scenes, program, total = sizes(folder)
    found = [
        f"{what} has {size / 1e6:.1f} MB, at most {most / 1e6:.0f} MB are allowed"
        for what, size, most in (
            ("the program", program, LARGEST_PROGRAM),
            *((f"the scene {name}", size, LARGEST_SCENE) for name, size in scenes.items()),
            ("the site", total, LARGEST_SITE),
        )
        if size > most
    ]
    programs = list(folder.rglob("*.wasm"))
    if len(programs) != 1:
        found.append(f"has {len(programs)} programs: all scenes share one")
    text = (folder / "index.html").read_text(encoding="utf-8")
    for link in re.findall(r'(?:src|href)="([^"#]+)"', text):
        path, _, query = link.partition("?")
        if not (folder / path).is_file():
            found.append(f"index.html links to {path}, which is missing")
        if query.startswith("scene=") and query[6:] not in scenes:
            found.append(f"index.html links to the scene {query[6:]}, which is missing")
    return found


if __name__ == "__main__":
    sys.exit(main())
