"""Devices that the drivers find on this machine, and the reasons why others cannot be used."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass

from palpate import _native
from palpate.devices.reading import DeviceLimits
from palpate.errors import DeviceError


@dataclass(frozen=True)
class Obstacle:
    """Why something is not there."""

    what: str  # what is wrong, and where
    advice: str  # what to do

    def __str__(self) -> str:
        return f"{self.what}: {self.advice}"


@dataclass(frozen=True)
class FoundDevice:
    """A device that a driver sees."""

    id: str  # by which a scene names it
    name: str  # model
    limits: DeviceLimits  # what it can render, as far as is known before it is opened
    obstacle: Obstacle | None  # why it cannot be opened now; None if it can
    facts: dict[str, str]  # such as its firmware, by name


@dataclass(frozen=True)
class Listing:
    """What one driver sees."""

    kind: str  # of the driver, as a scene names it
    found: tuple[FoundDevice, ...]
    missing: Obstacle | None  # why there are none, or no more; None where nothing is missing
    facts: dict[str, str]  # of the driver itself, such as its version and where its library lies, by name

    @property
    def ready(self) -> list[FoundDevice]:
        """Those that can be opened now."""
        return [device for device in self.found if device.obstacle is None]


def kinds() -> list[str]:
    """Kinds of devices that there are drivers for."""
    return _native.device_kinds()


def listed(kind: str, address: str | None = None, library: str | os.PathLike[str] | None = None) -> Listing:
    """Ask the driver of a kind what it sees; DeviceError if there is no such kind.

    ``address`` is that of its service, ``library`` the vendor's library; None for the driver's own.
    """
    if kind not in kinds():
        raise DeviceError(f"there is no driver of kind '{kind}': choose among {', '.join(kinds())}")
    raw = _native.list_devices(kind, address, library)
    found = tuple(
        FoundDevice(
            device["id"],
            device["name"],
            DeviceLimits(*device["limits"]),
            _obstacle(device["obstacle"]),
            dict(device["facts"]),
        )
        for device in raw["found"]
    )
    return Listing(kind, found, _obstacle(raw["missing"]), dict(raw["facts"]))


def listings(which: Sequence[str] | None = None) -> list[Listing]:
    """Ask the drivers of all kinds, or of some."""
    return [listed(kind) for kind in (kinds() if which is None else which)]


def _obstacle(pair: tuple[str, str] | None) -> Obstacle | None:
    return None if pair is None else Obstacle(*pair)
