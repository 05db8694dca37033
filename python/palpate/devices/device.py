"""Devices defined by a program: subclasses of `Device` that read the tool's pose and render forces, within limits.

A thread polls each of them. It may wait for the device and for the interpreter; the loop never does.
"""

from __future__ import annotations

import atexit
import contextlib
import math
import threading
import time
import warnings
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import astuple, dataclass
from typing import ClassVar

import numpy as np

from palpate import _native
from palpate.errors import DeviceError, DeviceWarning
from palpate.vectors import number, three_numbers

UPRIGHT = (1.0, 0.0, 0.0, 0.0)
# Most that a tip moves in a hand, m/s.
HAND_SPEED = 10.0
# How long a device may take to open and give its first reading, and to end its last call, s.
OPENING, CLOSING = 10.0, 2.0
# Time between two attempts of a device that has failed, s.
REOPEN_SECONDS = 0.1
LOWEST_RATE, HIGHEST_RATE = 50.0, 10_000.0


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


class PollingThread:
    """A device of a program, opened and polled on a thread of its own from :meth:`start` to :meth:`stop`, once.

    Parameters
    ----------
    device
        The device.
    rate
        How often it is polled unless it says so itself, Hz.

    Attributes
    ----------
    name
        What a person knows it by.
    failure
        Why it failed last, in one line; None if it has not.

    Raises
    ------
    DeviceError
        A rate out of range, or limits that are none.

    """

    def __init__(self, device: Device, rate: float):
        self.name = device.name or type(device).__name__
        if not isinstance(device.limits, DeviceLimits):
            kind = type(device.limits).__name__
            raise DeviceError(f"{self.name}: limits must be a palpate.DeviceLimits, got {kind}")
        rate = number(rate if device.rate is None else device.rate, f"{self.name}: rate", DeviceError)
        if not LOWEST_RATE <= rate <= HIGHEST_RATE:
            raise DeviceError(f"{self.name}: rate must be {LOWEST_RATE:g} to {HIGHEST_RATE:g} Hz, got {rate:g}")
        self.failure: str | None = None
        self._device = device
        self._period = 1.0 / rate
        self._ending, self._ready = threading.Event(), threading.Event()
        self._thread: threading.Thread | None = None
        self._refusal: DeviceError | None = None

    def start(self) -> _native.OpenedDevice:
        """Open the device and wait for its first reading; what a loop takes.

        Raises DeviceError, in one line, for what `open` or the first `read` raised, or because they took too long.
        """
        native = _native.ProgrammedDevice(self.name, self._device.limits.arguments, 1.0 / self._period)
        self._thread = threading.Thread(
            target=self._run, args=(native,), name=f"palpate-device {self.name}", daemon=True
        )
        # A program that ends without a word leaves no force behind: a daemon is not waited for.
        atexit.register(self.stop)
        self._thread.start()
        if not self._ready.wait(OPENING):
            self._refusal = DeviceError(f"{self.name}: open and the first read took more than {OPENING:g} s")
        if self._refusal is not None:
            self.stop()
            raise self._refusal
        return native.opened()

    def stop(self) -> None:
        """Put out zero, close the device and end the thread; a call of it that does not return is left behind."""
        atexit.unregister(self.stop)
        self._ending.set()
        thread, self._thread = self._thread, None
        if thread is None:
            return
        thread.join(CLOSING)
        if thread.is_alive():
            self._warn(
                "a method of the device does not return: it may still be open, with its last force: switch it off"
            )

    def _run(self, native: _native.ProgrammedDevice) -> None:
        """All that the thread does; nothing is raised out of it."""
        opened, message = self._call("open", self._device.open)
        if message is None:
            message = self._read(native)
        if message is not None:
            self._refusal = DeviceError(message)
        self._ready.set()
        try:
            if message is None:
                self._poll(native)
        finally:
            if opened:
                with contextlib.suppress(Exception):
                    self._device.write(np.zeros(3), np.zeros(3))
                _, message = self._call("close", self._device.close)
                if message is not None:
                    self._warn(message)

    def _poll(self, native: _native.ProgrammedDevice) -> None:
        """Read and write on a grid of deadlines until it is asked to end; what has failed is tried again at leisure."""
        due, failed = time.monotonic(), False
        while not self._ending.is_set():
            message = self._write(native) or self._read(native)
            if message is not None:
                self.failure = message
                native.fail()
                if not failed:
                    self._warn(message)
                with contextlib.suppress(Exception):
                    self._device.write(np.zeros(3), np.zeros(3))
            failed = message is not None
            now = time.monotonic()
            # Deadlines that have passed meanwhile are left out.
            due = max(due + self._period, now - self._period) if not failed else now + REOPEN_SECONDS
            if due > now:
                time.sleep(due - now)

    def _read(self, native: _native.ProgrammedDevice) -> str | None:
        """Publish a reading; why there is none."""
        reading, message = self._call("read", self._device.read)
        if message is not None:
            return message
        if reading is None:
            native.publish_absent()
            return None
        with contextlib.suppress(TypeError, ValueError, AttributeError, OverflowError):
            how = reading.orientation, reading.velocity, reading.angular_velocity, reading.buttons
            if native.publish(reading.position, *how):
                return None
        return f"{self.name}.read {reading_error(reading) or 'returned a reading that cannot be used'}"

    def _write(self, native: _native.ProgrammedDevice) -> str | None:
        """Put out the latest wrench; why it was not."""
        force, torque, _ = native.wrench()
        return self._call("write", self._device.write, np.array(force), np.array(torque))[1]

    def _call(self, what: str, call, *arguments):
        """Call a method of the device: what it returned, True for nothing, and its mistake in one line."""
        try:
            returned = call(*arguments)
        except Exception as error:
            lines = str(error).strip().splitlines()
            detail = f": {lines[0]}" if lines else ""
            return None, f"{self.name}.{what} raised {type(error).__name__}{detail}"
        return (returned if what == "read" else True), None

    def _warn(self, message: str) -> None:
        # A filter that makes warnings errors must not end the thread, which still has a force to take back.
        with contextlib.suppress(DeviceWarning):
            warnings.warn(message, DeviceWarning, stacklevel=2)
