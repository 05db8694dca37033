"""Theory of a mass on a sampled spring: a force computed from a sample acts after a delay, for a period.

With mass `m`, damping `b`, muscles `k` (all with those of a hand that holds the tip), period `T` and delay
`d = n T + rest`:

    m x'' + b x' + k x = u(t),      u = -K x(j T) for t in (j T + d, (j + 1) T + d)

The motion over a period is linear in position, velocity and the forces of `n` and `n + 1` periods ago, which makes a
matrix: the loop is stable while all its eigenvalues are within the unit circle.
"""

from __future__ import annotations

import numpy as np

from benches.emulation import Hand, Mechanics

# Steps by which the first unstable stiffness is looked for, and the relative width at which halving ends.
GROWTH, WIDTH = 1.1, 1e-6


def bound_for_any_hand(damping: float, period: float, delay: float) -> float:
    """`b / (T/2 + d)`, N/m: Colgate and Schenkel 1997; with the delay Diolaiti et al. 2006."""
    return damping / (0.5 * period + delay)


def largest_stable(mechanics: Mechanics, period: float, hand: Hand | None = None) -> float:
    """Largest stable stiffness without dry friction and encoder steps, N/m, from the eigenvalues."""
    mass, damping, muscles = mechanics.mass, mechanics.damping, 0.0
    if hand is not None:
        mass, damping, muscles = mass + hand.mass, damping + hand.damping, hand.stiffness
    parts = _parts(mass, damping, muscles, period, mechanics.delay)
    stable = 1e-3 * bound_for_any_hand(damping, period, mechanics.delay)
    unstable = stable
    while _radius(parts, unstable) < 1:
        stable, unstable = unstable, GROWTH * unstable
    while unstable > (1 + WIDTH) * stable:
        middle = 0.5 * (stable + unstable)
        stable, unstable = (middle, unstable) if _radius(parts, middle) < 1 else (stable, middle)
    return stable


def _parts(
    mass: float, damping: float, muscles: float, period: float, delay: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    """Transition of position and velocity over a period, the effects of the newer and older force, and their age."""
    from scipy.linalg import expm

    # Position, velocity and a force that is held.
    rates = np.array([[0.0, 1.0, 0.0], [-muscles / mass, -damping / mass, 1 / mass], [0.0, 0.0, 0.0]])
    age = int(np.floor(delay / period + 1e-12))
    rest = max(delay - age * period, 0.0)
    early, late = expm(rates * rest), expm(rates * (period - rest))
    return expm(rates * period)[:2, :2], late[:2, 2], late[:2, :2] @ early[:2, 2], age


def _radius(parts: tuple[np.ndarray, np.ndarray, np.ndarray, int], stiffness: float) -> float:
    """Spectral radius of the loop: position, velocity, and the forces of the last `age + 1` periods."""
    transition, newer, older, age = parts
    size = 2 + age + 1
    matrix = np.zeros((size, size))
    matrix[:2, :2] = transition
    matrix[2, 0] = -stiffness
    matrix[3:, 2:-1] = np.eye(age)
    # Column 1 + j holds the force of j periods ago; that of none follows from the position.
    matrix[:2, 1 + age + 1] += older
    if age == 0:
        matrix[:2, 0] -= stiffness * newer
    else:
        matrix[:2, 1 + age] += newer
    return float(np.abs(np.linalg.eigvals(matrix)).max())
