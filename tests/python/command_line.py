"""The command line as a user meets it: most tests call it in their own process, which saves its imports."""

from __future__ import annotations

import contextlib
import io
import signal
import subprocess
import sys
import warnings

import pytest
from typer.testing import CliRunner

from palpate.cli import main

# What Python shows of warnings by itself; under pytest they are errors.
DEFAULT_FILTERS = [("default", DeprecationWarning, "__main__")] + [
    ("ignore", category, "") for category in (DeprecationWarning, PendingDeprecationWarning, ResourceWarning)
]


def run_process(*arguments, cwd, **kwargs):
    """A command in a process of its own."""
    command = [sys.executable, "-c", "from palpate.cli import main; main()", *map(str, arguments)]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=280, **kwargs)


def run(*arguments, cwd):
    """A command in this process, with the exit status and the output that its own would have."""
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    words, code = ["palpate", *map(str, arguments)], 0
    out, err = io.StringIO(), io.StringIO()
    with (
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        pytest.MonkeyPatch.context() as patch,
        warnings.catch_warnings(),
    ):
        patch.chdir(cwd)
        patch.setattr(sys, "argv", words)
        warnings.resetwarnings()
        for action, category, module in reversed(DEFAULT_FILTERS):
            warnings.filterwarnings(action, category=category, module=module)
        try:
            main()
        except SystemExit as end:
            code = end.code or 0
        finally:
            for number, handler in handlers.items():
                signal.signal(number, handler)
    return subprocess.CompletedProcess(words, code, out.getvalue(), err.getvalue())


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
