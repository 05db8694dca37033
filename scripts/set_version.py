"""Give the next release its version: in Cargo.toml, in Cargo.lock, and as a heading of CHANGELOG.md.

Usage: set_version.py 0.2.0            writes it
       set_version.py --check v0.2.0   exit code 1 unless this is the version of the checkout
"""

from __future__ import annotations

import datetime
import re
import subprocess
import sys
from pathlib import Path

from check_wheel import ROOT, workspace_version

UNRELEASED = "## Unreleased\n"


def main() -> int:
    """Write or compare the version."""
    words = sys.argv[1:]
    if len(words) == 2 and words[0] == "--check":
        return check(words[1].removeprefix("v"))
    if len(words) != 1 or not re.fullmatch(r"\d+\.\d+\.\d+", words[0]):
        sys.exit(__doc__)
    write(words[0])
    return 0


def check(wanted: str) -> int:
    """Compare a version with that of the checkout and with the headings of the changelog."""
    if wanted != workspace_version():
        print(f"the tag says {wanted}, Cargo.toml {workspace_version()}", file=sys.stderr)
        return 1
    if f"## {wanted} " not in (ROOT / "CHANGELOG.md").read_text():
        print(f"CHANGELOG.md has no heading '## {wanted} (date)'", file=sys.stderr)
        return 1
    return 0


def write(version: str) -> None:
    """Write the version wherever cargo wants it, and turn what is unreleased into a release."""
    old = re.escape(workspace_version())
    manifests = [ROOT / "Cargo.toml", *ROOT.glob("crates/**/Cargo.toml")]
    for manifest in manifests:
        replace(manifest, rf'(?m)^((?:palpate-.*\bpath = .*)?version = )"{old}"', rf'\g<1>"{version}"')
    today = datetime.datetime.now(datetime.timezone.utc).date()
    replace(ROOT / "CHANGELOG.md", re.escape(UNRELEASED), f"{UNRELEASED}\n## {version} ({today})\n")
    subprocess.run(["cargo", "update", "--quiet", "--workspace", "--offline"], cwd=ROOT, check=True)


def replace(path: Path, pattern: str, text: str) -> None:
    """Replace a pattern in a file that is there for people to read."""
    path.write_text(re.sub(pattern, text, path.read_text()))


if __name__ == "__main__":
    sys.exit(main())
