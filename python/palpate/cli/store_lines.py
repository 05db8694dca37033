"""Lines about a precomputed store, for people."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from palpate.green import GreensFunction


def precision_line(green: GreensFunction) -> str:
    """Precision of its numbers, and what touches are right to."""
    from palpate.green import error_text

    touch, stamp = error_text(green.touch_error), error_text(green.stamp_error)
    return f"precision {green.precision}: touches right to {touch}, nodal forces under a stamp to {stamp}, as measured"


def green_line(green: GreensFunction) -> str:
    """Sizes of the body and of the file."""
    from palpate.mesh import size_text

    size = green.path.stat().st_size / 1e6
    return (
        f"Green's function of a body of {size_text(green.extents)}, {len(green.touchable_nodes)} of "
        f"{len(green.surface_nodes)} surface nodes touchable, {len(green.fixed_nodes)} nodes fixed, {green.precision}, "
        f"{size:.1f} MB"
    )
