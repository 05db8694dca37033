"""Write the figures of a command as JSON into docs/_results, with machine and commit, for the tables of the site.

Usage: python scripts/record_results.py verify            # palpate verify --json
       python scripts/record_results.py elements          # python -m benches elements --json
       python scripts/record_results.py palpation verify palpation
The first word names the file; the others are the arguments of the benchmark, by default the first word.
"""

from __future__ import annotations

import json
import subprocess
import sys
from datetime import date
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "docs" / "_results"
# Folders whose changes may change figures: a commit does not name them while they are changed.
SOURCES = ("crates", "python", "benches", "Cargo.lock")


def main() -> None:
    """Run the command, and write what it has printed."""
    sys.path.insert(0, str(ROOT))
    from benches.output import machine

    name, arguments = sys.argv[1], sys.argv[2:] or sys.argv[1:2]
    module = ["palpate"] if arguments[0] == "verify" else ["benches"]
    run = [sys.executable, "-m", *module, *arguments, "--json"]
    # `palpate verify` ends with 1 where a figure misses its tolerance: the table shows that.
    done = subprocess.run(run, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=False)
    results = json.loads(done.stdout)
    rows = results if isinstance(results, list) else results.pop("rows")
    record = {
        "command": " ".join(["palpate" if module == ["palpate"] else "python -m benches", *arguments]),
        "date": date.today().isoformat(),
        "commit": commit(),
        "machine": machine(),
        "rows": rows,
    }
    if isinstance(results, dict):
        record |= {key: value for key, value in results.items() if key != "machine"}
    RESULTS.mkdir(exist_ok=True)
    (RESULTS / f"{name}.json").write_text(json.dumps(record, indent=1) + "\n")


def commit() -> str:
    """Return the commit that the sources belong to, marked if they are changed."""
    head = git("rev-parse", "--short=10", "HEAD")
    return f"{head}, changed" if git("status", "--porcelain", "--", *SOURCES) else head


def git(*arguments: str) -> str:
    """Return what git prints."""
    return subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()


if __name__ == "__main__":
    main()
