"""Devices defined by a program: subclasses of `Device` that read the tool's pose and render forces."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np

from palpate import _native
from palpate.devices.polling import PollingThread
from palpate.devices.reading import DeviceLimits, Reading
from palpate.errors import DeviceError


class Device(ABC):
    """A haptic device that a program brings, to be given to :class:`palpate.Simulation`.

    All its methods are called on one thread, which polls it at the rate of the force loop: :meth:`read`, then
    :meth:`write`, over and over. However long they take, the loop ticks on: it takes the latest reading, and after
    50 ms without a new one its force is zero until a reset. If one of them raises, the tool has a fault, with the
    reason in a :class:`DeviceWarning` and in ``fault`` of a frame. The device is then tried again ten times a second.

    Attributes
    ----------
    name
        Name in messages; by default that of the class.
    limits
        What it can render.
    rate
        How often it is polled, Hz, 50 to 10 000; None for the rate of the loop.

    """

    name: ClassVar[str] | str = ""
    limits: DeviceLimits = DeviceLimits()
    rate: float | None = None
    _polling: PollingThread | None = None

    def open(self) -> None:
        """Get ready; called once, before the loop starts. What it raises ends the start."""
        return

    @abstractmethod
    def read(self) -> Reading | None:
        """Say where the tool is now; None takes it out of the scene."""

    @abstractmethod
    def write(self, force: np.ndarray, torque: np.ndarray) -> None:
        """Put out a force (3,), N, and a torque (3,), N m, on the hand, until the next call.

        They are never old: zero where the loop has stopped, has a fault or has not ticked for 25 ms.
        """

    def close(self) -> None:
        """Let go; called once, after a last force of zero."""
        return

    @property
    def failure(self) -> str | None:
        """Why it failed last, in one line; None if it has not since it was opened."""
        return None if self._polling is None else self._polling.failure

    def open_for_loop(self, rate: float) -> _native.OpenedDevice:
        """Open the device and begin to poll it, for a loop of so many ticks a second.

        Raises
        ------
        DeviceError
            A device that does not open or gives no first reading: why, in one line; one that another loop has.

        """
        if self._polling is not None:
            raise DeviceError(f"{self.name or type(self).__name__}: another tool or simulation has this device")
        polling = PollingThread(self, rate)
        opened = polling.start()
        self._polling = polling
        return opened

    def close_for_loop(self) -> None:
        """End that: a last force of zero, and close it."""
        polling, self._polling = self._polling, None
        if polling is not None:
            polling.stop()
