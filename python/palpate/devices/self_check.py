"""Self-check of one device: its readings, and whether small forces push in the right direction.

The forces are made in a loop at 1 kHz of the native module and pass the safety stage of the force loop; nothing is put
out before :meth:`SelfCheck.push` is called, and nothing any more from the tick on that sees a fault.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate import _native
from palpate.devices.device import Device, DeviceLimits
from palpate.errors import DeviceError

# Directions that forces are tried in, with the words for them: x to the right, y away from the person, z up.
DIRECTIONS = {
    "+x": ((1.0, 0.0, 0.0), "to the right"),
    "-x": ((-1.0, 0.0, 0.0), "to the left"),
    "+y": ((0.0, 1.0, 0.0), "away from you"),
    "-y": ((0.0, -1.0, 0.0), "towards you"),
    "+z": ((0.0, 0.0, 1.0), "up"),
    "-z": ((0.0, 0.0, -1.0), "down"),
}
# Tip movements below this show no direction, m: several times what encoders of desktop devices resolve.
VISIBLE = 2e-4
# A loop at 1 kHz wants readings as often; above this gap a device looks unplugged to the safety stage, s.
LOWEST_RATE, LONGEST_GAP = 500.0, 0.05
# Rate of the loop of a check, and between two looks at it, s.
LOOP_RATE, POLL_SECONDS = 1000.0, 0.02
LARGEST_FORCE: float = _native.DeviceCheck.largest_force


@dataclass(frozen=True)
class Watched:
    """What a device said while it was watched."""

    seconds: float  # how long
    # Measurements, and how many a second, Hz.
    readings: int
    rate: float
    longest_gap: float  # longest time between two, s
    deviation: tuple[float, float, float]  # standard deviation of the position by axis, m: at rest, its noise
    # Ends of the range seen by axis, m.
    lowest: tuple[float, float, float]
    highest: tuple[float, float, float]
    buttons: tuple[int, ...]  # those that were held at any time, by number
    fault: str | None  # what went wrong; None if nothing did

    @property
    def passed(self) -> bool:
        """Whether a force loop at 1 kHz can follow it."""
        fast = self.rate >= LOWEST_RATE and self.longest_gap <= LONGEST_GAP
        return self.fault is None and self.readings > 0 and fast


@dataclass(frozen=True)
class Push:
    """What a slowly rising force did."""

    direction: str  # one of :data:`DIRECTIONS`
    force: float  # largest force that was put out, N
    moved: float  # how far the tip went along it, m; negative is against it
    ran_away: bool  # whether it went so far that the force was taken back: nobody held it
    fault: str | None  # what went wrong; None if nothing did

    @property
    def verdict(self) -> str:
        """``along``, ``still``, ``against`` or ``fault``."""
        if self.fault is not None:
            return "fault"
        return "still" if abs(self.moved) < VISIBLE else "along" if self.moved > 0 else "against"

    @property
    def passed(self) -> bool:
        """Whether the tip did not go against the force."""
        return self.verdict in ("along", "still")


@dataclass(frozen=True)
class Checked:
    """All results of a check."""

    # Of the device.
    name: str
    limits: DeviceLimits
    # Watched at rest, and while it was moved through its workspace.
    rest: Watched
    range: Watched
    pushes: tuple[Push, ...] = ()  # one a direction; empty where no force was wanted

    @property
    def passed(self) -> bool:
        """Whether everything was as it should be."""
        return self.rest.passed and self.range.passed and all(push.passed for push in self.pushes)


class SelfCheck:
    """A device that is opened, watched and pushed with, as a context manager.

    Parameters
    ----------
    device
        A kind of :func:`palpate.devices.kinds`, or a device of a program.
    id, address, library
        Which one, its service, and the vendor's library; None for the driver's own.

    Attributes
    ----------
    name
        What a person knows the device by.
    limits
        What it can render.

    Raises
    ------
    DeviceError
        A device that cannot be opened: why, and what to do.

    """

    def __init__(
        self,
        device: str | Device,
        id: str | None = None,
        address: str | None = None,
        library: str | os.PathLike[str] | None = None,
    ):
        self._program = None if isinstance(device, str) else device
        if isinstance(device, str):
            opened = _native.OpenedDevice(device, id, address, library)
        else:
            opened = device.open_for_loop(LOOP_RATE)
        self._check = _native.DeviceCheck(opened)
        self.name, self.limits = self._check.name, DeviceLimits(*self._check.limits)

    def __enter__(self) -> SelfCheck:
        return self

    def __exit__(self, *_error: object) -> None:
        self.stop()

    def stop(self) -> None:
        """Leave the device without a force, and close it."""
        self._check.stop()
        if self._program is not None:
            self._program.close_for_loop()

    def watch(self, seconds: float, report: Callable[[dict[str, Any]], None] | None = None) -> Watched:
        """Watch it without any force; ``report`` hears of it meanwhile."""
        self._check.begin((0.0, 0.0, 0.0), 0.0, 0.0)
        seen = self._until(lambda seen: seen["time"] >= seconds or seen["fault"] is not None, seconds, report)
        return Watched(
            seen["time"],
            seen["fresh"],
            seen["fresh"] / seen["time"],
            seen["longest_gap"],
            tuple(seen["deviation"]),
            tuple(seen["lowest"]),
            tuple(seen["highest"]),
            tuple(k for k in range(32) if seen["buttons"] >> k & 1),
            seen["fault"],
        )

    def push(
        self, direction: str, force: float, seconds: float = 1.0, report: Callable[[dict[str, Any]], None] | None = None
    ) -> Push:
        """Push along one of :data:`DIRECTIONS` with a force, N, that rises over so many seconds and ends.

        The force is never more than :data:`LARGEST_FORCE` and what the device allows. It ends at once at a fault, where
        the device is out of the scene, and after 5 cm.
        """
        along = DIRECTIONS[direction][0]
        self._check.begin(along, force, seconds)
        seen = self._until(lambda seen: seen["done"], seconds, report)
        moved = float(np.dot(seen["moved"], along))
        return Push(direction, seen["largest_force"], moved, seen["ran_away"], seen["fault"])

    def _until(
        self, over: Callable[[dict[str, Any]], bool], seconds: float, report: Callable[[dict[str, Any]], None] | None
    ) -> dict[str, Any]:
        # A driver that calls the tick may stop calling: the clock decides then.
        deadline = time.monotonic() + 2.0 * seconds + 2.0
        while time.monotonic() < deadline:
            seen = self._check.seen()
            if seen is not None:
                if report is not None:
                    report(seen)
                if over(seen):
                    return seen
            time.sleep(POLL_SECONDS)
        raise DeviceError(f"{self.name}: its driver has stopped calling the loop: unplug it and start again")
