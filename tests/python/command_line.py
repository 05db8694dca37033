"""The command line as a user meets it, in a process of its own."""

from __future__ import annotations

import subprocess
import sys

from typer.testing import CliRunner


def run(*arguments, cwd, **kwargs):
    command = [sys.executable, "-c", "from palpate.cli import main; main()", *map(str, arguments)]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=280, **kwargs)


def refused(result, *words):
    assert result.returncode == 2, result
    lines = result.stderr.strip().splitlines()
    assert len(lines) == 1, result.stderr
    for word in words:
        assert word in lines[0], lines[0]


def run_bench(*arguments):
    """`python -m benches`, in this process."""
    from benches.__main__ import app

    return CliRunner().invoke(app, [*map(str, arguments)], catch_exceptions=False)
