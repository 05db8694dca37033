"""Relative errors at which a number format is chosen, a warning is raised, and an answer is refused."""

from __future__ import annotations

import warnings

from palpate import _native
from palpate.errors import PrecisionError, PrecisionWarning

# The cheapest format is taken whose typical contacts are right to this: a thirtieth of what is warned of, for answers
# with many prescribed nodes are several times more sensitive than those probed.
CHOSEN = 3e-4
# An answer that may be wrong by more than this is warned of: a hand feels differences of force of 5 to 10 %.
WARNED = 1e-2
# One that may be wrong by more than this is refused.
REFUSED = _native.REFUSED_ERROR


def error_text(error: float) -> str:
    """Write a relative error in per cent, with the digits it deserves."""
    return f"{100 * error:.2g} %"


def check_error(error: float, precision: str, what: str, stacklevel: int) -> None:
    """Warn of an estimated relative error, or refuse it; ``what`` is wrong by it, ``stacklevel`` as seen from here.

    Raises PrecisionError beyond :data:`REFUSED`.
    """
    # Not a number is refused, too.
    if not error <= REFUSED:
        size = error_text(error) if error < 1 else "all of it"
        bound = f"more than the {error_text(REFUSED)} allowed"
        raise PrecisionError(f"{what} may be wrong by {size}, {bound}: {remedy(error, precision)}")
    if error > WARNED:
        message = f"{what} may be wrong by {error_text(error)}: {remedy(error, precision)}"
        warnings.warn(message, PrecisionWarning, stacklevel=stacklevel + 1)


def remedy(error: float, precision: str) -> str:
    """Say why a format is not enough, and what is."""
    if precision == "f64":
        return (
            "parts of this body differ too much in stiffness for double precision; bring materials closer together, "
            "prescribe fewer neighbouring nodes, or fix more of the body"
        )
    # Single precision rounds to 1/256 of what sixteen bits do.
    better = "f32" if precision == "f16" and error < 256 * CHOSEN else "f64"
    return (
        f"the parts of this body, or the nodes prescribed, differ too much in stiffness for {precision}; "
        f"compute the store with --precision {better} (precision='{better}', in a scene body.precision)"
    )
