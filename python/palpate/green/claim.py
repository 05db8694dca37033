"""Lock on a store: one process at a time writes it, others wait."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from palpate import _native

# Between two attempts to claim a store, s.
PAUSE = 0.1


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
