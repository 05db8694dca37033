"""Turn large PNG pictures of the documents into WebP, and let the pages link to these.

Usage: python scripts/shrink_pictures.py [--out docs/images]

Pictures below 90 kB stay as they are. The result is at most 150 kB each; a picture that is larger is an error.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).parents[1]
MIN_BYTES, MAX_BYTES = 90_000, 150_000


def shrunk(path: Path) -> Path:
    """Write a picture as WebP beside itself, remove the PNG, and return the new path."""
    target = path.with_suffix(".webp")
    with Image.open(path) as picture:
        picture.convert("RGB").save(target, quality=82, method=6)
    path.unlink()
    return target


def relink(names: dict[str, str]) -> None:
    """Replace the names of pictures in the pages."""
    for page in [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")]:
        text = page.read_text()
        new = text
        for old, name in names.items():
            new = new.replace(f"images/{old})", f"images/{name})")
        if new != text:
            page.write_text(new)


def main() -> int:
    """Shrink all pictures of a folder."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "images")
    folder = parser.parse_args().out
    large = [path for path in sorted(folder.glob("*.png")) if path.stat().st_size >= MIN_BYTES]
    names = {path.name: shrunk(path).name for path in large}
    # Pages name the WebP files already where only the picture was taken anew.
    relink(names)
    too_large = [path.name for path in sorted(folder.iterdir()) if path.stat().st_size > MAX_BYTES]
    print(f"{len(names)} pictures shrunk; all take {sum(p.stat().st_size for p in folder.iterdir()) / 1e3:.0f} kB")
    for name in too_large:
        print(f"shrink_pictures: {name} has more than {MAX_BYTES // 1000} kB", file=sys.stderr)
    return 1 if too_large else 0


if __name__ == "__main__":
    sys.exit(main())
