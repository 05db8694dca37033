"""The cache: the folder of precomputed files, and its contents."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from palpate.errors import StoreError
from palpate.leftovers import is_leftover

# Ending of what a process is still writing.
_WRITTEN = re.compile(r"\.\d+\.(new|partial)$")
# Longest header of a store that is read to say what it is, bytes.
HEADER_BYTES = 10_000_000


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
