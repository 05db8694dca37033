"""The command line."""

from palpate.cli import benchmarks, caching, doctor, envelope, palpating, running, verification  # noqa: F401  they register their commands
from palpate.cli.app import main

__all__ = ["main"]
