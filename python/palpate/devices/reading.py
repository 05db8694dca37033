"""Readings and limits of a device."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass

import numpy as np

from palpate.errors import DeviceError
from palpate.vectors import number, three_numbers

UPRIGHT = (1.0, 0.0, 0.0, 0.0)
# Most that a tip moves in a hand, m/s.
HAND_SPEED = 10.0


@dataclass(frozen=True)
class DeviceLimits:
    """What a device can render. Quantities without a limit are infinite. The limits of the scene apply as well.

    Attributes
    ----------
    max_force, max_torque
        Largest force, N, and torque, N m; 0 N m for a device without rotary motors.
    max_stiffness
        Stiffest contact that it holds without oscillating, N/m. Where a scene asks for more, contacts are rendered as
        soft as that, and warned of.
    max_damping, max_angular_damping
        Strongest damping that it holds, N s/m and N m s/rad.
    own_damping
        Viscous damping of its mechanics at the tip, N s/m; None where it is not known. With it the stiffness is held
        below ``own_damping / (T/2 + delay)``.
    delay
        Time from a measurement to the force that answers it, s, beyond the tick and the polling, which count by
        themselves.
    max_speed
        Fastest that a hand moves the tip, m/s: what looks faster is a fault of its sensors. None for a pose that is
        commanded and may jump.
    rate
        Fastest rate at which it takes forces, Hz; None for any.

    Raises
    ------
    DeviceError
        A limit that is negative or not a number.

    """

    max_force: float = math.inf
    max_torque: float = math.inf
    max_stiffness: float = math.inf
    max_damping: float = math.inf
    max_angular_damping: float = math.inf
    own_damping: float | None = None
    delay: float = 0.0
    max_speed: float | None = HAND_SPEED
    rate: float | None = None

    def __post_init__(self):
        for name, value in vars(self).items():
            if value is None and name in ("own_damping", "max_speed", "rate"):
                continue
            if not (isinstance(value, (int, float)) and not isinstance(value, bool) and value >= 0):
                raise DeviceError(f"limits of a device: {name} must be a number from zero on, got {value!r}")

    @property
    def arguments(self) -> tuple[float | None, ...]:
        """As the native module takes them."""
        return astuple(self)


@dataclass(frozen=True)
class Reading:
    """Measurement of a device, in its own frame: x to the right, y away from the person, z up.

    Attributes
    ----------
    position
        Of the tip, m.
    orientation
        Of the tool, a unit quaternion w x y z.
    velocity, angular_velocity
        m/s and rad/s. They are recorded; forces follow from positions alone.
    buttons
        Held buttons, a bit each: bit 0 holds on to what the tool touches.

    """

    position: Sequence[float]
    orientation: Sequence[float] = UPRIGHT
    velocity: Sequence[float] = (0.0, 0.0, 0.0)
    angular_velocity: Sequence[float] = (0.0, 0.0, 0.0)
    buttons: int = 0


def reading_error(reading: object) -> str | None:
    """Say what is wrong with what :meth:`Device.read` returned, in a few words; None if nothing is."""
    if not isinstance(reading, Reading):
        return f"returned {type(reading).__name__}, not a palpate.Reading"
    try:
        for name in ("position", "velocity", "angular_velocity"):
            three_numbers(_plain_numbers(getattr(reading, name)), name, DeviceError)
        parts = [number(part, "orientation", DeviceError) for part in _plain_numbers(reading.orientation)]
    except (DeviceError, TypeError) as error:
        return f"returned a reading whose {error}"
    if len(parts) != 4:
        return f"returned a reading whose orientation has {len(parts)} numbers: w x y z are needed"
    length = math.hypot(*parts)
    if abs(length - 1.0) > 1e-3:
        return f"returned a reading whose orientation is no unit quaternion: its length is {length:.4g}"
    buttons = reading.buttons
    if not isinstance(buttons, (int, np.integer)) or not 0 <= buttons < 2**32:
        return f"returned a reading whose buttons are {buttons!r}: a bit each is needed, from 0 to 2**32 - 1"
    return None


def _plain_numbers(values: object) -> object:
    """Numbers of NumPy as those of Python."""
    return values.tolist() if isinstance(values, np.ndarray) else values
