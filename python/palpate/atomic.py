"""Files appear whole or not at all: written beside, then renamed."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

from palpate.leftovers import remove_leftovers


@contextlib.contextmanager
def written_beside(path: Path) -> Iterator[Path]:
    """Give a path to write to, which becomes ``path`` when the block ends well, and is deleted otherwise.

    Raises
    ------
    OSError
        From within the block, naming ``path`` (a full disk names nothing).

    """
    remove_leftovers(path)
    partial = path.with_name(f".{os.getpid()}.{path.name}")
    try:
        yield partial
        os.replace(partial, path)
    except OSError as error:
        error.filename = os.fspath(path)
        raise
    finally:
        partial.unlink(missing_ok=True)
