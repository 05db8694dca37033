"""The command line."""

from palpate.cli import (  # noqa: F401  they register their commands
    benchmarks,
    caching,
    devices,
    doctor,
    envelope,
    examining,
    packing,
    palpating,
    recordings,
    running,
    scaling,
    session_bench,
    sessions,
    stability,
    studying,
    verification,
)
from palpate.cli.app import main

__all__ = ["main"]
