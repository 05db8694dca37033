"""Files appear whole or not at all: written beside, then renamed."""

from __future__ import annotations

import contextlib
import os
import shutil
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


@contextlib.contextmanager
def folder_beside(path: Path) -> Iterator[Path]:
    """Give an empty folder to fill, which takes the place of ``path`` when the block ends well, and else is deleted."""
    remove_leftovers(path)
    partial = path.with_name(f".{os.getpid()}.{path.name}")
    before = path.with_name(f".{os.getpid()}.{path.name}.before")
    partial.mkdir()
    try:
        yield partial
        # A folder that is not empty cannot be replaced in one step.
        if path.exists():
            os.replace(path, before)
        os.replace(partial, path)
    except OSError as error:
        error.filename = os.fspath(path)
        raise
    finally:
        shutil.rmtree(partial, ignore_errors=True)
        shutil.rmtree(before, ignore_errors=True)
