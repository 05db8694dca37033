"""Devices that the drivers find on this machine or that are on the USB, and the reasons why others cannot be used.

Numbers on the USB: Force Dimension and Novint as udev rules for their devices have them; 3D Systems as the kernel
reports a Touch, 2988 with several products, and 0301:2988, vendor and product exchanged. Haply's devices are known to
their service alone.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from palpate import _native
from palpate.devices.device import DeviceLimits
from palpate.errors import DeviceError

RULES = "/etc/udev/rules.d/70-palpate-haptics.rules"


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
            one["id"], one["name"], DeviceLimits(*one["limits"]), _obstacle(one["obstacle"]), dict(one["facts"])
        )
        for one in raw["found"]
    )
    return Listing(kind, found, _obstacle(raw["missing"]), dict(raw["facts"]))


def listings(which: Sequence[str] | None = None) -> list[Listing]:
    """Ask the drivers of all kinds, or of some."""
    return [listed(kind) for kind in (kinds() if which is None else which)]


def _obstacle(pair: tuple[str, str] | None) -> Obstacle | None:
    return None if pair is None else Obstacle(*pair)


@dataclass(frozen=True)
class UsbDevice:
    """A device that is plugged in."""

    kind: str  # of the driver that it belongs to
    name: str  # maker, or model
    # Its numbers, four hexadecimal digits each.
    vendor: str
    product: str
    node: str  # file by which programs open it; "" if it has none yet
    allowed: bool  # whether this user may read and write that file
    remedy: tuple[str, ...]  # what gives the permission, a line each


@dataclass(frozen=True)
class _Known:
    """Devices of a maker: their products, any if there are none, and whether they are serial ports."""

    kind: str
    name: str
    vendor: str
    products: tuple[str, ...] = ()
    serial: bool = False


KNOWN = (
    _Known("forcedimension", "Force Dimension", "1451"),
    _Known("forcedimension", "Novint Falcon", "0403", ("cb48",)),
    _Known("touch", "3D Systems Touch", "2988", serial=True),
    _Known("touch", "3D Systems Touch", "0301", ("2988",), serial=True),
)


def usb_devices(root: Path = Path("/")) -> list[UsbDevice]:
    """Haptic devices that are plugged in; none on systems that do not list them as Linux does."""
    found = []
    for folder in sorted((root / "sys/bus/usb/devices").glob("*")):
        vendor, product = _number(folder / "idVendor"), _number(folder / "idProduct")
        for known in KNOWN:
            if vendor == known.vendor and (not known.products or product in known.products):
                found.append(_plugged(root, folder, known, vendor, product))
    return found


def udev_rule(vendor: str, product: str | None = None) -> str:
    """Rule that lets the local user open the devices of a maker."""
    which = f'ATTR{{idVendor}}=="{vendor}"' + (f', ATTR{{idProduct}}=="{product}"' if product else "")
    return f'SUBSYSTEM=="usb", {which}, MODE="0660", TAG+="uaccess"'


def _plugged(root: Path, folder: Path, known: _Known, vendor: str, product: str) -> UsbDevice:
    node = _serial_port(root, folder) if known.serial else _bus_node(root, folder)
    allowed = node is not None and os.access(root / node.lstrip("/"), os.R_OK | os.W_OK)
    return UsbDevice(known.kind, known.name, vendor, product, node or "", allowed, _remedy(known, root, node))


def _remedy(known: _Known, root: Path, node: str | None) -> tuple[str, ...]:
    if known.serial:
        group = _group_of(root / node.lstrip("/")) if node else "dialout"
        return (f"sudo usermod -aG {group} $USER", "# log out and in again; check with: groups")
    rule = udev_rule(known.vendor, known.products[0] if known.products else None)
    return (
        f"echo '{rule}' | sudo tee -a {RULES}",
        "sudo udevadm control --reload-rules && sudo udevadm trigger",
        "# then unplug the device and plug it in again",
    )


def _group_of(path: Path) -> str:
    """Group of a file; that of serial ports on Debian where it has no name."""
    try:
        return path.group()
    except (OSError, KeyError):
        return "dialout"


def _number(path: Path) -> str | None:
    try:
        return path.read_text().strip().lower()
    except OSError:
        return None


def _bus_node(root: Path, folder: Path) -> str | None:
    """File of the device on its bus, such as ``/dev/bus/usb/001/004``."""
    bus, number = _number(folder / "busnum"), _number(folder / "devnum")
    if bus is None or number is None:
        return None
    node = f"/dev/bus/usb/{int(bus):03d}/{int(number):03d}"
    return node if (root / node.lstrip("/")).exists() else None


def _serial_port(root: Path, folder: Path) -> str | None:
    """Find the serial port of one of its interfaces, such as ``/dev/ttyACM0``."""
    for port in sorted(folder.glob("*/tty/tty*")):
        if (root / "dev" / port.name).exists():
            return f"/dev/{port.name}"
    return None
