"""Haptic devices on the USB are known by their numbers, and the permission that is missing is told with its remedy."""

from __future__ import annotations

import pytest

from palpate.devices import listing, usb_devices

BUS = "sys/bus/usb/devices"
# As Linux shows a Falcon, an omega, a Touch on a serial port, and a keyboard.
PLUGGED = {
    f"{BUS}/1-1/idVendor": "0403\n",
    f"{BUS}/1-1/idProduct": "CB48\n",
    f"{BUS}/1-1/busnum": "1\n",
    f"{BUS}/1-1/devnum": "7\n",
    "dev/bus/usb/001/007": "",
    f"{BUS}/1-2/idVendor": "1451\n",
    f"{BUS}/1-2/idProduct": "0402\n",
    f"{BUS}/1-2/busnum": "1\n",
    f"{BUS}/1-2/devnum": "12\n",
    f"{BUS}/2-1.4/idVendor": "2988\n",
    f"{BUS}/2-1.4/idProduct": "0302\n",
    f"{BUS}/2-1.4/2-1.4:1.0/tty/ttyACM3/dev": "166:3\n",
    "dev/ttyACM3": "",
    f"{BUS}/1-3/idVendor": "0403\n",
    f"{BUS}/1-3/idProduct": "6001\n",
    f"{BUS}/usb1/uevent": "",
}


@pytest.fixture
def root(tmp_path):
    for name, text in PLUGGED.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def test_haptic_devices_are_known_by_their_numbers(root):
    falcon, omega, touch = usb_devices(root)
    assert (falcon.kind, falcon.name, falcon.node) == ("forcedimension", "Novint Falcon", "/dev/bus/usb/001/007")
    assert (omega.kind, omega.name, omega.node) == ("forcedimension", "Force Dimension", "")
    assert (touch.kind, touch.name, touch.node) == ("touch", "3D Systems Touch", "/dev/ttyACM3")
    assert falcon.allowed and touch.allowed and not omega.allowed, "the system has no file for the omega"
    assert usb_devices(root / "dev") == []


def test_the_missing_permission_is_told_with_its_remedy(root, monkeypatch):
    monkeypatch.setattr(listing.os, "access", lambda path, mode: False)
    falcon, omega, touch = usb_devices(root)
    assert not (falcon.allowed or touch.allowed)
    assert 'ATTR{idVendor}=="0403", ATTR{idProduct}=="cb48"' in falcon.remedy[0]
    assert 'ATTR{idVendor}=="1451", MODE="0660", TAG+="uaccess"' in omega.remedy[0]
    # Rules of 73 and above come after the one that gives access to whoever sits there.
    assert int(omega.remedy[0].rpartition("/")[2].partition("-")[0]) < 73
    assert "udevadm control --reload-rules" in omega.remedy[1]
    assert touch.remedy[0] == f"sudo usermod -aG {(root / 'dev/ttyACM3').group()} $USER"
