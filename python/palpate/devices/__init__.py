"""Haptic devices: those defined by a program, those found by the drivers, and the self-check of one."""

from palpate.devices.device import Device, DeviceLimits, Reading
from palpate.devices.listing import FoundDevice, Listing, Obstacle, UsbDevice, kinds, listed, listings, usb_devices
from palpate.devices.self_check import DIRECTIONS, Checked, Push, SelfCheck, Watched
