"""Weighted up-down staircase: the contrast of the next trial (Kaernbach, Perception & Psychophysics 49, 227-229, 1991).

A right answer makes the next nodule harder to feel by the step `d`, a wrong one easier by `u`, on the logarithm of the
felt contrast. Where the probability of a right answer is `p`, the mean step is `(1 - p) u - p d`: it vanishes at the
target for `u / d = p / (1 - p)`, and there the staircase hovers.

Whoever says "none" has not guessed. That answer is scored as the mean of a guess among `m` places, `1/m` right
(Kaernbach, Perception & Psychophysics 63, 1377-1388, 2001): the staircase moves by the mean step.
"""

from __future__ import annotations

import math

# Down-step, a ratio of contrasts: large until the answers have turned twice, to come down from the start, then small,
# to stay among the contrasts that tell most. Of 1.12, 1.18, 1.25 and 1.35 the smallest gives the smallest spread.
STEP, FIRST_STEP, FIRST_REVERSALS = math.log(1.12), math.log(1.56), 2


class Staircase:
    """Level of the next trial.

    Parameters
    ----------
    low, high
        Felt contrasts between which it stays; it starts at the highest, which is easiest.
    target
        Probability of a right answer at which it hovers.

    """

    def __init__(self, low: float, high: float, target: float):
        self._low, self._high, self._target = math.log(low), math.log(high), target
        self._level = self._high
        self._reversals = 0
        self._last_right: bool | None = None

    @property
    def contrast(self) -> float:
        """Felt contrast that the next trial should have."""
        return math.exp(self._level)

    def answered(self, score: float) -> None:
        """Move on after an answer: 1 for a right one, 0 for a wrong one, between them for none."""
        right = score > 0.5
        if self._last_right not in (None, right):
            self._reversals += 1
        self._last_right = right
        down = FIRST_STEP if self._reversals < FIRST_REVERSALS else STEP
        up = down * self._target / (1.0 - self._target)
        self._level = min(max(self._level + (1.0 - score) * up - score * down, self._low), self._high)
