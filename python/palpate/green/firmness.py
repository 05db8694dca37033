"""How firmly supports hold a body, beside an elastic half-space of the same material."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from palpate.errors import Error

if TYPE_CHECKING:
    from palpate.green.function import GreensFunction

# A body below this share of a half-space's stiffness is held too loosely: a slender beam has a hundredth.
LOOSE = 1e-3
# Points within this share of the height below the highest one are as high.
LEVEL = 0.02


def firmness(green: GreensFunction, radius: float) -> float | None:
    """Stiffness of the softest of the highest touchable points over that of a half-space under a flat punch, ``2 E a``.

    Poisson's ratio, which makes the half-space stiffer by a third at most, is left out. The patch that is pressed has a
    ``radius``, m. None for a body of several materials.
    """
    if green.youngs_modulus is None or not radius > 0:
        return None
    places = green.surface_positions[np.searchsorted(green.surface_nodes, green.touchable_nodes)]
    height = places[:, 2]
    upper = places[height >= height.max() - LEVEL * np.ptp(height)]
    # Ends of the top: a rod that lies is soft at one of them.
    ends = {int(rank(upper[:, axis])) for axis in (0, 1) for rank in (np.argmin, np.argmax)}
    depth = 1e-6 * radius
    stiffness = [_stiffness(green, upper[end], radius, depth) for end in ends]
    return min(stiffness) / (2 * green.youngs_modulus * radius)


def _stiffness(green: GreensFunction, place: np.ndarray, radius: float, depth: float) -> float:
    try:
        return abs(float(green.touch(place, (None, None, -depth), radius).force[2])) / depth
    except Error:
        # On or beside the supports.
        return np.inf
