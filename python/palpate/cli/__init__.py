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
    session_bench,
    sessions,
    stability,
    verification,
)
from palpate.cli.app import main

__all__ = ["main"]
