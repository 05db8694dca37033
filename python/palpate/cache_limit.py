"""Size limit of the cache: files used least recently are deleted first, files that a process has open stay."""

from __future__ import annotations

import contextlib
import os
import shutil
import weakref
from collections import defaultdict
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from palpate.cache import CachedFile, cache_directory, cached_files
from palpate.errors import StoreError
from palpate.units import memory

try:
    import fcntl
except ImportError:
    # Windows has no such locks: it does not delete a file that a process has open.
    fcntl = None

# Without a limit of their own: so many bytes, or this part of the disk where that is less.
DEFAULT_LIMIT, DEFAULT_PART = 10e9, 0.1

# Files of the cache that this process has used: what `palpate run` reports.
_used: set[Path] = set()


class Limit(NamedTuple):
    """Bytes that the cache may take, and whether somebody has set them."""

    size: int
    is_set: bool


def cache_limit() -> Limit:
    """Bytes that the cache may take; StoreError if the file that holds the limit was damaged."""
    file = _file()
    try:
        size = int(file.read_text())
    except FileNotFoundError:
        return Limit(int(min(DEFAULT_LIMIT, DEFAULT_PART * shutil.disk_usage(_existing(file.parent)).total)), False)
    except ValueError:
        size = 0
    if size <= 0:
        raise StoreError(f"{file}: holds no size; set one by 'palpate cache limit 10GB'")
    return Limit(size, True)


def set_cache_limit(size: str | float | None) -> None:
    """Limit the cache from now on, bytes or text such as ``"20GB"``, and make room; None: the limit by default.

    Raises UnitError for no size; StoreError for a size that is not positive.
    """
    file = _file()
    if size is None:
        file.unlink(missing_ok=True)
    else:
        wanted = int(memory(size))
        if wanted <= 0:
            raise StoreError(f"the limit of the cache must be positive, got {size}; 'palpate cache clear' empties it")
        file.parent.mkdir(parents=True, exist_ok=True)
        beside = file.with_name(f".{os.getpid()}.{file.name}")
        beside.write_text(f"{wanted}\n")
        os.replace(beside, file)
    make_room()


def make_room(needed: int = 0, keep: Path | None = None) -> None:
    """Delete what was used least recently until ``needed`` more bytes fit; all but ``keep`` and what is in use."""
    limit = cache_limit().size
    groups = _groups()
    total = needed + sum(group.size for group in groups)
    for group in sorted(groups, key=lambda group: group.last_use):
        if total <= limit:
            return
        if keep not in group.paths and group.remove():
            total -= group.size


def hold(path: Path | None, user: object) -> None:
    """Note that a file of the cache is used, and keep it there as long as ``user`` lives."""
    if path is None or path.parent != cache_directory():
        return
    _used.add(path)
    with contextlib.suppress(OSError):
        # The time of change stands for that of use: few systems note that of reading, and a list reads too.
        os.utime(path)
    with contextlib.suppress(OSError):
        stream = os.open(path, os.O_RDONLY)
        weakref.finalize(user, os.close, stream)
        if fcntl is not None:
            fcntl.flock(stream, fcntl.LOCK_SH | fcntl.LOCK_NB)


def kept_by_this_process() -> int:
    """Bytes in the cache that this process has used: stores, with what belongs to them."""
    return sum(group.size for group in _groups() if group.paths & _used)


@dataclass
class _Group:
    """Files that are of use together: a store, what tools need to know of it, what an interrupted computation left."""

    files: list[CachedFile] = field(default_factory=list)

    @property
    def paths(self) -> set[Path]:
        return {file.path for file in self.files}

    @property
    def size(self) -> int:
        return sum(file.size for file in self.files)

    @property
    def last_use(self) -> float:
        """Leftovers were never used."""
        return max((0.0 if file.leftover else file.used) for file in self.files)

    def remove(self) -> bool:
        """Delete the files, unless some process has one of them open."""
        with contextlib.ExitStack() as locks:
            for file in self.files:
                if file.being_written or not _locked(file.path, locks):
                    return False
            try:
                for file in self.files:
                    file.path.unlink(missing_ok=True)
            except PermissionError:
                return False
        return True


def _locked(path: Path, locks: contextlib.ExitStack) -> bool:
    """Lock a file until the stack ends; False where a process holds it."""
    if fcntl is None:
        return True
    try:
        stream = locks.enter_context(path.open("rb"))
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except FileNotFoundError:
        return True
    except OSError:
        return False
    return True


def _groups() -> list[_Group]:
    groups: defaultdict[str, _Group] = defaultdict(_Group)
    folder = cache_directory()
    for file in cached_files():
        name = file.path.name.lstrip(".") if file.path.parent == folder else str(file.path)
        groups[name.split(".")[0] if file.path.parent == folder else name].files.append(file)
    return list(groups.values())


def _file() -> Path:
    return cache_directory() / "limit"


def _existing(folder: Path) -> Path:
    while not folder.exists():
        folder = folder.parent
    return folder
