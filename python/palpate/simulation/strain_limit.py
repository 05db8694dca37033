"""A tool whose displacement is limited where a pose would leave what linear elasticity can say.

Beyond about 10 % strain a linear solution balloons. While a contact sticks, the displacements are affine in the tool's
displacement `d` from its anchor, `u = u_free + sum_k d_k U_k`, and so is what a strain measure samples
(:mod:`palpate.fields.strain_measure`): four samples, taken when the contact begins, give the strain of any displacement
by a weighted sum. The target that the simulated device follows is then `anchor + s d` with the largest `s <= 1` at
which no place is strained beyond the limit, the body's own loads included. Places that those loads alone strain beyond
it do not count: no tool could bring them back.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from palpate.simulation.frame import Contact
from palpate.simulation.simulation import Simulation

# Strain stays this part of the limit below it, found to the same accuracy in at most so many steps.
MARGIN = 1e-3
STEPS = 20


class LimitedTool:
    """A simulated tool whose targets are limited; the contact is looked at when it moves and at each :meth:`update`.

    Parameters
    ----------
    simulation
        The running loop.
    limit
        Largest strain; 0 lets the tool go anywhere.
    tool
        Which one. Other tools are taken to touch without force.

    """

    def __init__(self, simulation: Simulation, limit: float, tool: int = 0):
        self._simulation, self._limit, self._tool = simulation, limit, tool
        self._reach: _Reach | None = None
        self.wanted: np.ndarray | None = None
        self.limited = False

    def move(self, position: Sequence[float] | np.ndarray) -> None:
        """Send the tool towards a position, m, as far as the limit lets it."""
        self.wanted = np.array(position, dtype=float)
        self.update()

    def update(self) -> None:
        """Limit the target for the contact as it is now: call it about as often as the pose is looked at."""
        if self.wanted is None:
            return
        reach = self._current_reach() if self._limit > 0 else None
        share = 1.0 if reach is None else reach.share(self.wanted - reach.contact.anchor)
        self.limited = share < 1.0
        if reach is None or not self.limited:
            self._simulation.move(self.wanted, tool=self._tool)
        else:
            anchor = reach.contact.anchor
            self._simulation.move(anchor + share * (self.wanted - anchor), tool=self._tool)

    def remove(self) -> None:
        """Take the tool out of the scene."""
        self._simulation.remove(self._tool)
        self.wanted, self.limited, self._reach = None, False, None

    def _current_reach(self) -> _Reach | None:
        """Prepare the contact when another one has begun; None while nothing is touched."""
        contact = next((c for c in self._simulation.contacts() if c.tool == self._tool), None)
        if contact is None:
            if not self._bounced_off():
                self._reach = None
        elif self._reach is None or not self._reach.holds_for(contact, self._simulation.stiffness_scale):
            answer = self._simulation.contact_response(self._tool)
            self._reach = None if answer is None else _Reach(self._simulation, *answer, self._limit)
        return self._reach

    def _bounced_off(self) -> bool:
        """Whether a body in motion has left a tool that still wants into it.

        Until the body is back the tool stays within the limit of the contact before, or it would be hit all the harder.
        """
        if self._reach is None or self.wanted is None or self._simulation.motion is None:
            return False
        return float((self.wanted - self._reach.contact.anchor) @ self._reach.contact.normal) < 0


class _Reach:
    """How far the tool of one contact may go."""

    def __init__(self, simulation: Simulation, contact: Contact, response: np.ndarray, limit: float):
        self.contact = contact
        # Near a support the stiffness of a contact is limited, and its response depends on the body's own.
        self._scale = simulation.stiffness_scale
        self._limit, self._margin, self._measure = limit, MARGIN * limit, simulation.strain_measure
        free = simulation.green.free_displacements
        self._base = self._measure.sample(free)
        self._slopes = np.stack([self._measure.sample(free + field) - self._base for field in response])
        self._counted = self._measure.magnitudes(self._base) < limit - self._margin

    def holds_for(self, contact: Contact, scale: float) -> bool:
        mine = self.contact
        same_place = np.array_equal(mine.anchor, contact.anchor) and np.array_equal(mine.nodes, contact.nodes)
        return same_place and np.array_equal(mine.weights, contact.weights) and scale == self._scale

    def share(self, displacement: np.ndarray) -> float:
        """Largest share of a displacement from the anchor, up to 1, within the limit.

        The excess over the limit goes to zero by chords, in a single one where the body has no loads: recovered strain
        is then proportional to the share. The end that stays is given half its excess (the Illinois rule), for the
        in-plane Green strain is quadratic.
        """
        step = np.tensordot(displacement, self._slopes, axes=1)
        low, high = 0.0, 1.0
        low_excess, high_excess = self._excess(low, step), self._excess(high, step)
        if high_excess <= self._margin:
            return 1.0
        for _ in range(STEPS):
            share = low - (high - low) * low_excess / (high_excess - low_excess)
            excess = self._excess(share, step)
            if abs(excess) <= self._margin:
                return share
            if excess < 0:
                low, low_excess, high_excess = share, excess, 0.5 * high_excess
            else:
                high, high_excess, low_excess = share, excess, 0.5 * low_excess
        return low

    def _excess(self, share: float, step: np.ndarray) -> float:
        """Largest strain of the places that count, less the limit; the margin keeps what is reported within it."""
        magnitudes = self._measure.magnitudes(self._base + share * step)
        return float(magnitudes.max(initial=0.0, where=self._counted)) - self._limit + self._margin
