"""The folder of precomputed files."""

from __future__ import annotations

import os
from pathlib import Path


def cache_directory() -> Path:
    """Folder of precomputed files: ``$XDG_CACHE_HOME/palpate``."""
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "palpate"
