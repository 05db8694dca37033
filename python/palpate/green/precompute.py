"""Green's functions from their files, or computed and written there."""

from __future__ import annotations

import contextlib
import json
import os
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from palpate import _native
from palpate.body import Body, description, problem_arrays
from palpate.cache import cache_directory
from palpate.errors import BodyError, PrecisionWarning, StoreError, StoreWarning
from palpate.green.bounds import CHOSEN, WARNED, error_text, remedy
from palpate.green.function import GreensFunction
from palpate.green.memory import allowed_memory
from palpate.input_file import require_writable
from palpate.leftovers import remove_leftovers
from palpate.progress import progress_reporter
from palpate.units import brief_repr


def precompute(
    body: Body,
    *,
    precision: str | None = None,
    touch: Sequence[int] | np.ndarray | None = None,
    path: str | os.PathLike[str] | None = None,
    memory: int | str | None = None,
    progress: bool | Callable[[int, int], None] = True,
) -> GreensFunction:
    """Green's function of a body, from its file if that matches, else computed and written there.

    An interrupted computation leaves what it finished in ``<path>.partial``; the next one with the same arguments goes
    on from there, to the same bits.

    Parameters
    ----------
    body
        A supported body, with its loads.
    precision
        Stored number format: ``"f16"``, ``"f32"`` or ``"f64"``, of 2, 4 and 8 bytes an entry. Answers are computed in
        double from what is stored. None: the cheapest in which typical contacts of this body are right to 0.03 %, as
        measured on some columns.
    touch
        Surface nodes that may be touched; None: all.
    path
        File; None keeps it in the cache under its content key.
    memory
        Bytes that the process may take at its peak, or text such as ``"8GB"``; None: as many as are useful. The
        operator itself is written as it is computed, and takes none.
    progress
        True shows a bar on a terminal; a function is called with columns done and in all.

    Raises
    ------
    BodyError
        A body that its supports leave free to move, a touch node that is not on the surface, or a bound of memory that
        cannot be kept.

    Warns
    -----
    PrecisionWarning
        Touches may be wrong by more than 1 %.

    """
    if not isinstance(body, Body):
        raise BodyError(f"precompute takes a palpate.Body, got {brief_repr(body)}")
    body.require_supported()
    problem = problem_arrays(body, touch)
    key = _native.GreenCore.content_key(problem, precision)
    if path is None:
        target = cache_directory() / f"{key[:32]}.palpate"
        target.parent.mkdir(parents=True, exist_ok=True)
    else:
        target = Path(path)
        require_writable(target, StoreError)
    remove_leftovers(target)
    if target.exists():
        with contextlib.suppress(StoreError):
            return _told(GreensFunction(_native.GreenCore.load(target, key), body))
    allowed = None if memory is None else allowed_memory(memory)
    with progress_reporter("precomputing", progress) as report:
        _, discarded = _native.GreenCore.precompute_to(
            problem, precision, CHOSEN, json.dumps(description(body)), report, target, allowed
        )
    if discarded:
        warnings.warn(
            f"{target}.partial belonged to another computation and was thrown away", StoreWarning, stacklevel=2
        )
    return _told(GreensFunction(_native.GreenCore.load(target, key), body))


def _told(green: GreensFunction) -> GreensFunction:
    """Warn of a store in which touches may be wrong."""
    if not green.touch_error <= WARNED:
        said = f"touches of this body may be wrong by {error_text(green.touch_error)}"
        warnings.warn(f"{said}: {remedy(green.touch_error, green.precision)}", PrecisionWarning, stacklevel=3)
    return green
