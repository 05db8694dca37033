"""Checks of files that are read or written, the one reader of TOML, and quiet for libraries that read files."""

from __future__ import annotations

import contextlib
import logging
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from palpate.atomic import destination
from palpate.errors import Error

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib


def require_file(path: Path, error: type[Error]) -> None:
    """Raise ``error`` for what cannot be read as a file: nothing there, a folder, or an empty file."""
    if path.is_dir():
        raise error(f"{path} is a folder: name a file in it")
    if not path.exists():
        near = _with_other_ending(path)
        raise error(f"{path}: no such file" + (f"; there is {near.name}" if near else ""))
    if path.is_file() and path.stat().st_size == 0:
        raise error(f"{path}: the file is empty")


def read_toml(path: Path, error: type[Error]) -> tuple[str, dict[str, Any]]:
    """Text of a TOML file, for the lines of mistakes in it, and its tables; ``error`` for what is none."""
    require_file(path, error)
    text = path.read_text(encoding="utf-8", errors="replace")
    try:
        return text, tomllib.loads(text)
    except tomllib.TOMLDecodeError as mistake:
        raise error(f"{path}: {mistake}") from None


def require_writable(path: Path, error: type[Error]) -> None:
    """Refuse a place where no file can be put, before long work ends there.

    Raises ``error`` for a folder of that name, a device, a pipe or a socket, or no folder to put it in.
    """
    if path.is_dir():
        raise error(f"{path} is a folder: name a file in it, such as {path / 'body'}{path.suffix}")
    folder = destination(path, error).absolute().parent
    if not folder.is_dir():
        raise error(f"{path}: there is no folder {path.parent if not path.is_symlink() else folder}; make it first")


def require_replaceable(folder: Path, mark: str, error: type[Error]) -> None:
    """Raise ``error`` for a place that a folder cannot take: a file, or a folder with other things than ``mark``."""
    if folder.is_dir() and any(folder.iterdir()) and not (folder / mark).is_file():
        raise error(f"{folder}: is a folder of something else: give another name")
    if folder.exists() and not folder.is_dir():
        raise error(f"{folder}: is a file: give another name, or delete it first")
    if not folder.absolute().parent.is_dir():
        raise error(f"{folder}: there is no folder {folder.parent}; make it first")


def _with_other_ending(path: Path) -> Path | None:
    """Only file of the same name and another ending, or the same name in other letters."""
    if not path.parent.is_dir():
        return None
    others = [other for other in path.parent.iterdir() if other.stem.lower() == path.stem.lower() and other.is_file()]
    return others[0] if len(others) == 1 else None


def reason_text(error: Exception) -> str:
    """Why a library could not read a file, in one short line."""
    return " ".join(str(error).split())[:150] or type(error).__name__


@contextlib.contextmanager
def quiet(library: str) -> Iterator[None]:
    """Keep a library's warnings, and its log of what it got over or mended, from the terminal."""
    log = logging.getLogger(library)
    level = log.level
    log.setLevel(logging.CRITICAL + 1)
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            yield
    finally:
        log.setLevel(level)
