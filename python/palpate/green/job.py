"""A precomputation to be run: its problem, its target file, the checks of memory and disk space.

One process at a time writes a store, others wait.
"""

from __future__ import annotations

import contextlib
import json
import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from palpate import _native
from palpate.atomic import destination, remove_leftovers
from palpate.body import Body, SurfaceRegion, description, problem_arrays, surface_region
from palpate.cache import cache_directory, make_room
from palpate.errors import BodyError, StoreError
from palpate.green.function import GreensFunction
from palpate.green.resources import DiskUse, allowed_memory, available_memory, require_room
from palpate.input_file import require_writable
from palpate.units import brief_repr

# Number formats of stores.
PRECISIONS = ("f16", "f32", "f64")
# Between two attempts to claim a store, s.
PAUSE = 0.1


@dataclass(frozen=True)
class Job:
    """A precomputation that may begin."""

    body: Body  # what it is of
    region: np.ndarray  # surface nodes that may be touched, ascending
    problem: tuple[np.ndarray, ...]  # as the native module takes it
    first: np.ndarray  # nodes that are computed first, as ranks among the surface nodes; empty for all at once
    key: str  # of the finished store
    target: Path  # its file
    precision: str | None  # as asked for; None lets the body choose

    @classmethod
    def of(
        cls,
        body: Body,
        precision: str | None,
        touch: SurfaceRegion | None,
        first: SurfaceRegion | None,
        path: str | os.PathLike[str] | None,
    ) -> Job:
        """Check everything that can be checked before a number is computed; errors as of :func:`palpate.precompute`."""
        if not isinstance(body, Body):
            raise BodyError(f"precompute takes a palpate.Body, got {brief_repr(body)}")
        if precision not in (None, *PRECISIONS):
            raise BodyError(
                f"unknown precision {brief_repr(precision)}: use {', '.join(map(repr, PRECISIONS))} or None"
            )
        body.require_supported()
        region = surface_region(body, touch, "touch")
        nodes = np.empty(0, np.int64) if first is None else np.intersect1d(surface_region(body, first, "first"), region)
        if first is not None and not len(nodes):
            raise BodyError("first: none of its nodes may be touched, because they lie outside of touch")
        problem = problem_arrays(body, region)
        key = _native.GreenCore.content_key(problem, precision)
        if path is None:
            target = cache_directory() / f"{key[:32]}.palpate"
            target.parent.mkdir(parents=True, exist_ok=True)
        else:
            target = Path(path)
            require_writable(target, StoreError)
            target = destination(target, StoreError)
            _require_store(target)
        remove_leftovers(target)
        first_ranks = np.searchsorted(body.mesh.surface_nodes, nodes).astype(np.uint32)
        return cls(body, region, problem, first_ranks, key, target, precision)

    @property
    def rows(self) -> int:
        """Rows of the operator: dofs of the surface, and supported ones inside."""
        inside = ~np.isin(self.body.fixed_dofs // 3, self.body.mesh.surface_nodes)
        return 3 * len(self.body.mesh.surface_nodes) + int(inside.sum())

    @property
    def description(self) -> str:
        """What the file says it was made from, in JSON."""
        return json.dumps(description(self.body))

    def make_room(self, written: bool = False) -> None:
        """Delete old files where the cache would exceed its limit with what is going to be written there, or was."""
        if self.target.parent == cache_directory():
            store = DiskUse.of(3 * len(self.region), self.rows, self.precision or "f16", False).store
            make_room(0 if written else store, self.target)

    def stored(self) -> GreensFunction | None:
        """Give what is in the file, if that matches."""
        if self.target.exists():
            # It may be deleted meanwhile, to make room in the cache.
            with contextlib.suppress(StoreError, FileNotFoundError):
                return self.load()
        return None

    def load(self) -> GreensFunction:
        """Read the finished store."""
        return GreensFunction(_native.GreenCore.load(self.target, self.key), self.body)

    def load_growing(self) -> GreensFunction:
        """Read what is ready of a store that grows: another key for each stage."""
        return GreensFunction(_native.GreenCore.load(self.target), self.body)

    def allowed(self, memory: int | str | None) -> int | None:
        """Bytes of memory that may be taken, once the files have room; Error if they have not, or no memory is left."""
        in_stages = 0 < len(self.first) < len(self.region)
        require_room(self.target, 3 * len(self.region), self.rows, self.precision or "f16", in_stages)
        return available_memory() if memory is None else allowed_memory(memory)


def _require_store(path: Path) -> None:
    """Refuse to overwrite what is no store; a damaged one is written anew."""
    if not path.exists() or path.stat().st_size == 0:
        return
    with path.open("rb") as file:
        start = file.read(64)
    # Length of the header, and the header in JSON, as of safetensors.
    if not start[8:].startswith(b'{"__metadata__"'):
        raise StoreError(f"{path}: exists, and is no store: give another name, or delete it first")


@contextlib.contextmanager
def claimed(target: Path, waiting: Callable[[], None]) -> Iterator[_native.StoreClaim]:
    """Claim the store at ``target`` until the block ends, as soon as no other process computes it.

    ``waiting`` is called before every pause. Raises OSError if no file can be written there.
    """
    while (claim := _native.StoreClaim.take(target)) is None:
        waiting()
        time.sleep(PAUSE)
    try:
        yield claim
    finally:
        claim.release()


def waiting_message(target: Path) -> str:
    """Message for the time of waiting."""
    return f"another process is computing {target}: waiting for it"
