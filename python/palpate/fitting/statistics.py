"""Intervals of a least-squares fit, and whether its data can separate the unknowns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# Neighbours that agree more than this many standard errors of white noise are correlated.
CORRELATED = 2.0
MOST_CORRELATED = 0.98
# A leverage is at most this.
MOST_LEVERAGE = 0.95


@dataclass(frozen=True)
class Spread:
    """Covariance (p, p) of the unknowns, the factor of an interval's half-width, and the condition of their columns."""

    covariance: np.ndarray
    factor: float
    condition: float
    inflation: float

    @property
    def half_widths(self) -> np.ndarray:
        """Half the width of each interval (p,)."""
        return self.factor * np.sqrt(np.diag(self.covariance))


def spread_of(jacobian: np.ndarray, residuals: np.ndarray, curve: np.ndarray, confidence: float) -> Spread:
    """Return the spread of the unknowns at the minimum.

    The covariance is `(J^T J)^-1 J^T diag(r^2 / (1 - h)^2) J (J^T J)^-1` (HC3: MacKinnon and White, J. Econometrics 29,
    1985), which holds for noise that grows with the force too. Residuals of a law that does not fit go along together:
    with the correlation `c` of neighbours there are as many independent rows as `n (1 - c)/(1 + c)`.
    """
    from scipy.special import stdtrit  # Student's distribution without the half second that scipy.stats takes

    n, p = jacobian.shape
    scale = np.linalg.norm(jacobian, axis=0)
    scale[scale == 0] = 1e-300
    left, singular, right = np.linalg.svd(jacobian / scale, full_matrices=False)
    singular = np.maximum(singular, 1e-9 * singular[0])
    leverage = np.minimum((left**2).sum(axis=1), MOST_LEVERAGE)
    pseudo = (right.T / singular) @ left.T
    weighted = pseudo * (residuals / (1.0 - leverage))
    inflation = _inflation(residuals, curve)
    covariance = inflation * (weighted @ weighted.T) / np.outer(scale, scale)
    freedom = max(1.0, n / inflation - p)
    quantile = float(stdtrit(freedom, 0.5 + 0.5 * confidence))
    return Spread(covariance, quantile, singular[0] / singular[-1], inflation)


def _inflation(residuals: np.ndarray, curve: np.ndarray) -> float:
    same = curve[1:] == curve[:-1]
    together = (residuals[1:] * residuals[:-1])[same].sum() / max((residuals**2).sum(), 1e-300)
    if together < CORRELATED / np.sqrt(len(residuals)):
        return 1.0
    together = min(together, MOST_CORRELATED)
    return float((1.0 + together) / (1.0 - together))
