"""The command line."""

from palpate.cli import (  # they register their commands
    caching,
    catalogue,
    describing,
    devices,
    examining,
    fitting,
    mapping,
    packing,
    precomputing,
    running,
    sessions,
    studying,
    validating,
)
from palpate.cli.app import main

__all__ = ["main"]
