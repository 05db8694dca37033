"""The command line."""

from palpate.cli import (  # they register their commands
    caching,
    devices,
    doctor,
    examining,
    fitting,
    mapping,
    packing,
    precomputing,
    recordings,
    running,
    sessions,
    studying,
    verification,
    web,
)
from palpate.cli.app import main

__all__ = ["main"]
