"""The cache: the folder of precomputed files, its contents, and its size limit.

Files used least recently are deleted first; files that a process has open stay.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
import shutil
import weakref
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from palpate.atomic import is_leftover, written_beside
from palpate.errors import StoreError
from palpate.units import memory

try:
    import fcntl
except ImportError:
    # Windows has no such locks: it does not delete a file that a process has open.
    fcntl = None

# Ending of what a process is still writing.
_WRITTEN = re.compile(r"\.\d+\.(new|partial)$")
# Longest header of a store that is read to say what it is, bytes.
HEADER_BYTES = 10_000_000
# Without a limit of their own: so many bytes, or this part of the disk where that is less.
DEFAULT_LIMIT, DEFAULT_PART = 10e9, 0.1

# Files of the cache that this process has used: what `palpate run` reports.
_used: set[Path] = set()


def digest(value: Any) -> str:
    """Checksum of what JSON can hold, whatever the order of its keys."""
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()


def cache_directory() -> Path:
    """Folder of precomputed files: ``$XDG_CACHE_HOME/palpate``."""
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "palpate"


@dataclass(frozen=True)
class CachedFile:
    """A file of the cache."""

    path: Path
    name: str  # by which it is listed and deleted: the path in the cache, the hash of stores cut short
    size: int  # bytes
    used: float  # when it was last written, or read by a precomputation or a scene, s since 1970
    about: str  # what it is, in a few words
    leftover: bool  # whether it is of no more use: the process that wrote it was killed
    being_written: bool  # whether a process is writing it


def cached_files() -> list[CachedFile]:
    """Files of the cache, the last used first."""
    folder = cache_directory()
    found = []
    for file in (*folder.glob("*.palpate*"), *folder.glob(".*.palpate*"), *folder.glob("bench/*")):
        with contextlib.suppress(FileNotFoundError):  # another process may rename or delete it meanwhile
            found.append(_entry(file, folder))
    return sorted(found, key=lambda file: -file.used)


def chosen_files(name: str) -> list[CachedFile]:
    """Files of the cache by name, or by the beginning of it; StoreError if there are none."""
    files = cached_files()
    chosen = [file for file in files if name in (file.name, file.path.name, str(file.path))]
    chosen = chosen or [file for file in files if file.path.name.startswith(name) and name]
    if not chosen:
        raise StoreError(f"no file in the cache is called '{name}'; 'palpate cache list' shows their names")
    return chosen


def _entry(file: Path, folder: Path) -> CachedFile:
    stat = file.stat()
    leftover = is_leftover(file)
    relative = file.relative_to(folder).as_posix()
    head, dot, ending = relative.partition(".")
    name = f"{head[:12]}{dot}{ending}" if head and "/" not in relative else relative
    written = not leftover and _WRITTEN.search(file.name) is not None
    return CachedFile(file, name, stat.st_size, stat.st_mtime, _description(file, leftover), leftover, written)


def _description(file: Path, leftover: bool) -> str:
    if leftover:
        return "left by a killed process"
    if _WRITTEN.search(file.name):
        return "being written"
    if file.name.endswith(".partial"):
        return "interrupted; the same computation continues from here"
    if file.suffix != ".palpate":
        return "mesh of a benchmark"
    if file.name.endswith(".felt.palpate"):
        return "forces over the nodules of an exam"
    try:
        made_of = _metadata(file)
    except (OSError, ValueError, KeyError, TypeError):
        return "not a store"
    if made_of.get("format") == "palpate-contact":
        return "what a tool needs to know of the body with the same beginning"
    if file.name.endswith(".series.palpate"):
        return "series beyond small strain of the store with the same beginning"
    kind = "modes" if file.name.endswith(".modes.palpate") else f"Green's function, {made_of.get('precision', '')}"
    try:
        about = json.loads(made_of.get("description") or "{}")
    except ValueError:
        return "not a store"
    counts = f"{about.get('nodes')} nodes, {about.get('tets')} {about.get('element')} tetrahedra" if about else ""
    moduli = [f"{1e-3 * values[0]:.4g} kPa" for values in about.get("materials", {}).values()]
    return ", ".join(filter(None, [kind, counts, " and ".join(dict.fromkeys(moduli))]))


def _metadata(file: Path) -> Mapping[str, Any]:
    """Read the texts at the head of a safetensors file."""
    with file.open("rb") as stream:
        length = int.from_bytes(stream.read(8), "little")
        if length > HEADER_BYTES:
            raise ValueError("no header")
        return json.loads(stream.read(length))["__metadata__"]


class Limit(NamedTuple):
    """Bytes that the cache may take, and whether they were set by ``palpate cache limit``."""

    size: int
    is_set: bool


def cache_limit() -> Limit:
    """Bytes that the cache may take; StoreError if the file that holds the limit was damaged."""
    file = _file()
    try:
        size = int(file.read_text())
    except FileNotFoundError:
        there = next(folder for folder in file.parents if folder.exists())
        return Limit(int(min(DEFAULT_LIMIT, DEFAULT_PART * shutil.disk_usage(there).total)), False)
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
        with written_beside(file) as beside:
            beside.write_text(f"{wanted}\n")
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
