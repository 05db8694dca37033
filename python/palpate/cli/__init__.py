"""The command line."""

from palpate.cli import (  # noqa: F401  they register their commands
    benchmarks,
    caching,
    doctor,
    envelope,
    examining,
    packing,
    palpating,
    recordings,
    running,
    session_bench,
    sessions,
    verification,
)
from palpate.cli.app import main

__all__ = ["main"]
