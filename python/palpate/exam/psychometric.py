"""Estimate of the Weber fraction from answers: signal detection in one of `m` places, maximum likelihood.

Model. A press on place `i` is felt as a stiffness `K_i (1 + w n_i)` with independent standard normal `n_i`: noise in
proportion to what is felt, Weber's law. `w` is the Weber fraction: the standard deviation of one look over what is
looked at, so that a nodule that is felt harder by `dK/K = w` lies one standard deviation away from its surroundings,
`d' = 1`. Whoever takes the hardest of `m` places is right if the one with the nodule, `(1 + x)(1 + w n)` for the felt
contrast `x`, is felt harder than the `m - 1` others, `1 + w n_i`:

    P(x; w) = int phi(t) Phi(x/w + (1 + x) t)^(m - 1) dt

(Green and Swets 1966, ch. 2; Hacker and Ratcliff, Perception & Psychophysics 26, 168-170, 1979, for equal variances,
`x -> 0` at a given `d' = x/w`). Chance, `1/m`, is its value at `x = 0`. With a lapse in the share `l` of the trials,
where the answer is a guess, `psi = l/m + (1 - l) P` (Wichmann and Hill, Perception & Psychophysics 63, 1293, 2001).

Two looks in turn (`m = 2`) are told apart in 76 % of the trials at `x = w`; the difference at 75 %, which is often
quoted as the just noticeable one, is `0.954 w`.

Estimate. `w` and `l` that make the answers most probable, `l` within Wichmann and Hill's bounds; the interval holds
every `w` whose profile likelihood (over `l`) is not significantly smaller: `2 (L - L(w)) <= chi^2_1(0.95) = 3.84`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

# Weber fractions that are searched, and lapse rates.
GRID = np.geomspace(2e-3, 1.0, 450)
LAPSES = np.linspace(0.0, 0.06, 7)
# Half of the 95 % quantile of chi squared with one degree of freedom.
HALF_QUANTILE = 1.9207
# Contrasts beyond so many Weber fractions are not told apart.
FARTHEST = 50.0
# Points of the quadrature over the noise, and its half width; the trapezoidal rule converges faster than any power.
POINTS, HALF_WIDTH = 81, 7.0


@dataclass(frozen=True)
class Estimate:
    """Estimate of a hand from its answers."""

    weber_fraction: float  # the most probable one
    # Of the 95 % interval; 0 and infinity where the answers do not bound it.
    low: float
    high: float
    lapse_rate: float  # share of trials in which the answer is a guess whatever is felt
    alternatives: int  # places of the task

    def probability(self, contrasts: np.ndarray) -> np.ndarray:
        """Probability (n,) of a right answer at felt contrasts (n,)."""
        right = proportion_correct(np.asarray(contrasts, dtype=float), self.weber_fraction, self.alternatives)
        return self.lapse_rate / self.alternatives + (1.0 - self.lapse_rate) * right

    def contrast_at(self, probability: float) -> float:
        """Felt contrast that would be found with a probability if there were no lapses."""
        return contrast_at(probability, self.weber_fraction, self.alternatives)


def proportion_correct(contrasts: np.ndarray, weber_fraction: np.ndarray | float, alternatives: int) -> np.ndarray:
    """`P(x; w)` of the module's text; contrasts and Weber fractions are broadcast against each other."""
    x, w = np.broadcast_arrays(np.asarray(contrasts, dtype=float), np.asarray(weber_fraction, dtype=float))
    t = np.linspace(-HALF_WIDTH, HALF_WIDTH, POINTS)
    weights = np.exp(-0.5 * t * t)
    weights /= weights.sum()
    arguments = (x / w)[..., None] + (1.0 + x)[..., None] * t
    return np.exp((alternatives - 1) * scipy.special.log_ndtr(arguments)) @ weights


def contrast_at(probability: float, weber_fraction: float, alternatives: int) -> float:
    """Felt contrast at which `P(x; w)` has a value above chance; infinite where it stays below.

    What is felt of a hard nodule is as noisy as it is hard: `P` comes no nearer to one than `Phi(1/w)`.
    """

    def above(distance: float) -> float:
        right = proportion_correct(np.array(distance * weber_fraction), weber_fraction, alternatives)
        return float(right) - probability

    if above(FARTHEST) <= 0.0:
        return np.inf
    # In units of w, the scale on which the function is steep.
    return weber_fraction * float(scipy.optimize.brentq(above, 0.0, FARTHEST, xtol=1e-6))


class Psychometrics:
    """Likelihoods of answers of a task with so many places, at the felt contrasts (k,) that occur; prepared once."""

    def __init__(self, contrasts: np.ndarray, alternatives: int):
        self._alternatives = alternatives
        right = proportion_correct(np.asarray(contrasts, dtype=float)[:, None], GRID, alternatives)
        psi = LAPSES[:, None, None] / alternatives + (1.0 - LAPSES[:, None, None]) * right
        # Right to the last digit is as good as certain; the logarithm of what is left must stay finite.
        psi = np.clip(psi, 1e-12, 1.0 - 1e-12)
        self._log_right, self._log_wrong = np.log(psi), np.log1p(-psi)

    def estimate(self, which: np.ndarray, scores: np.ndarray) -> Estimate:
        """Weber fraction from trials: number (n,) of the contrast of each, and its score (n,) from 0 to 1."""
        count = self._log_right.shape[1]
        right = np.bincount(which, weights=scores, minlength=count)
        wrong = np.bincount(which, weights=1.0 - np.asarray(scores), minlength=count)
        likelihood = np.einsum("k,lkw->lw", right, self._log_right) + np.einsum("k,lkw->lw", wrong, self._log_wrong)
        profile = likelihood.max(axis=0)
        best = int(profile.argmax())
        within = np.flatnonzero(profile >= profile[best] - HALF_QUANTILE)
        low = 0.0 if within[0] == 0 else float(GRID[within[0]])
        high = np.inf if within[-1] == len(GRID) - 1 else float(GRID[within[-1]])
        lapse = float(LAPSES[likelihood[:, best].argmax()])
        return Estimate(float(GRID[best]), low, float(high), lapse, self._alternatives)


def estimate(contrasts: np.ndarray, scores: np.ndarray, alternatives: int) -> Estimate:
    """Weber fraction from felt contrasts (n,) and scores (n,): 1 for a right answer, 0 for a wrong one."""
    distinct, which = np.unique(np.asarray(contrasts, dtype=float), return_inverse=True)
    return Psychometrics(distinct, alternatives).estimate(which, np.asarray(scores, dtype=float))
