"""Taylor series of a hyperelastic body's displacement, stored beside its Green's function."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from palpate import _native
from palpate.body import Body, problem_arrays
from palpate.body.material import element_laws
from palpate.green.function import GreensFunction


def force_series(
    green: GreensFunction, body: Body, radius: float, progress: Callable[[int, int], None] | None = None
) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the coefficients of the higher orders of the displacement below spheres of a radius, m, and their places.

    They are read from the file beside the store, or computed and written there. None for a linear body, one with loads
    and one whose store has no file.

    Parameters
    ----------
    progress
        Called with places done and all of them.

    Returns
    -------
    fields, positions
        (k, 9) and (k, 3), m, at the smooth sides of the surface nodes. With the outward normal `n` and the pressing
        force `F = -n . f` of a force `f` on the body, `U = F^2 b_3 . f + F^3 b_4 . f` is added to its complementary
        energy: `b_3` (m/N^2), `b_4` (m/N^3), `1/F_e` (1/N) of the force at which the series ends, and `kappa` (1/N^2)
        and `alpha` (1/N) of a body that hardens, where `F^2` and `F^3` stand for functions that grow more slowly
        (docs/theory.md, chapter 11).

    """
    if green.path is None or body.loads is not None or not body.is_hyperelastic:
        return None
    problem = problem_arrays(body, green.touchable_nodes)
    return _native.series(problem, element_laws(body.mesh, body.material), radius, green.path, green.key, progress)
