"""The closed loop of bodies, emulated device and simulated hand, without a clock."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass, replace

import numpy as np

from palpate import _native
from palpate.errors import Error
from palpate.simulation import Simulation

INFINITE = float("inf")
# Largest force, slew, ramp and strongest damping of a safety stage that changes nothing, of one whose passivity
# controller alone is there, with the damping of the strongest device, and of a scene's after its ramp.
BARE = (INFINITE, INFINITE, 0.0, 0.0)
CONTROLLED = (INFINITE, INFINITE, 0.0, 30.0)
RAMPED_IN = (8.0, 500.0, 0.0, 30.0)


@dataclass(frozen=True)
class Mechanics:
    """A device at its tip, the same along every axis.

    Attributes
    ----------
    mass, damping
        kg, N s/m.
    dry_friction
        Coulomb's, N.
    encoder_step
        m; 0 for a continuous position.
    delay
        From a written force to its action, s.

    """

    mass: float
    damping: float
    dry_friction: float = 0.0
    encoder_step: float = 0.0
    delay: float = 0.0


@dataclass(frozen=True)
class Hand:
    """A hand that holds the tip: what it adds in mass, kg, and damping, N s/m, and its muscles, N/m."""

    mass: float
    damping: float
    stiffness: float


# The hands of `palpate_devices::emulated::known`, where their sources are.
LOOSE, FIRM = Hand(0.1, 2.0, 100.0), Hand(0.3, 10.0, 800.0)


@dataclass(frozen=True)
class Device:
    """A device by name: its mechanics, and what it says that it renders, N, N/m and N s/m."""

    name: str
    mechanics: Mechanics
    max_force: float = INFINITE
    max_stiffness: float = INFINITE
    max_damping: float = INFINITE


def known_devices() -> dict[str, Device]:
    """Devices that are sold by name, with mechanics that are partly assumed."""
    rows = ((name, Mechanics(*mechanics), *limits) for name, limits, mechanics in _native.known_devices())
    return {row[0]: Device(*row) for row in rows}


@dataclass(frozen=True)
class Held:
    """A device in somebody's hand.

    Attributes
    ----------
    device
        Which.
    start, velocity
        Of the tip at first, (3,) m and m/s.
    hand, waypoints
        Who holds it, and when (s) he wants to be where (m); None for nobody.
    grab
        Whether the tool holds on to what it touches.

    """

    device: Device
    start: Sequence[float]
    velocity: Sequence[float] = (0.0, 0.0, 0.0)
    hand: Hand | None = None
    waypoints: Sequence[tuple[float, Sequence[float]]] = ()
    grab: bool = False

    def arguments(self) -> tuple:
        """In the order of the native module."""
        device = self.device
        limits = (device.max_force, device.max_stiffness, device.max_damping)
        hand = None
        if self.hand is not None:
            places = [(float(time), tuple(map(float, place))) for time, place in self.waypoints]
            hand = (astuple(self.hand), places or [(0.0, tuple(map(float, self.start)))])
        tip = [tuple(map(float, vector)) for vector in (self.start, self.velocity)]
        return astuple(device.mechanics), limits, tip, hand, self.grab


@dataclass(frozen=True, eq=False)
class Motion:
    """What happened, (ticks, tools, 3): in truth, m and m/s, as measured, m, and forces on the devices, N."""

    positions: np.ndarray
    velocities: np.ndarray
    measured: np.ndarray
    forces: np.ndarray

    def __len__(self) -> int:
        return len(self.positions)


def emulate(
    simulation: Simulation,
    held: Sequence[Held],
    period: float,
    ticks: int,
    stage: tuple[float, float, float, float] | None = None,
    reach: float = INFINITE,
) -> Motion:
    """Ticks on emulated devices, one a tool, ``period`` seconds apart, until one is ``reach`` metres away.

    ``stage`` None is that of the scene.

    Raises
    ------
    Error
        A tool that may ask for more stiffness than its device holds; a fault of the loop.

    """
    arguments = [one.arguments() for one in held]
    answer = _native.emulate(simulation._core, arguments, stage, period, (ticks, reach))
    if answer["fault"] is not None:
        raise Error(f"the loop stopped: {answer['fault']}")
    names = ("positions", "velocities", "measured", "forces")
    return Motion(*(answer[name].reshape(-1, len(held), 3) for name in names))


def unlimited_device(device: Device) -> Device:
    """Return the device without the limits that it states."""
    return replace(device, max_force=INFINITE, max_stiffness=INFINITE, max_damping=INFINITE)


def frictionless(device: Device) -> Device:
    """Return the device without its dry friction, which would hold a tip at rest that the rest of it does not."""
    return replace(device, name=f"{device.name}, no friction", mechanics=replace(device.mechanics, dry_friction=0.0))
