"""A device of a program: readings and wrenches go through, whatever its methods do to the thread that calls them."""

from __future__ import annotations

import math
import os
import subprocess
import sys
import threading
import time
import warnings
from pathlib import Path

import numpy as np
import pytest
from held_device import Held, unstarved

import palpate
from palpate.devices import SelfCheck
from palpate.devices.device import PollingThread

RISE = 0.4


def check(sign):
    """Watch and push a device of this sign."""

    def attempt():
        device = Held(sign)
        with SelfCheck(device) as result:
            rest, push = result.watch(0.3), result.push("+x", 0.4, RISE)
        return (device, rest, push), push.fault

    return unstarved(attempt)


def fault_of(device):
    """Push a device that goes wrong until it does."""

    def attempt():
        made_device = device()
        with SelfCheck(made_device) as result:
            push = result.push("+x", 0.4, 10.0)
        return (made_device, push), push.fault

    return unstarved(attempt)


@pytest.mark.parametrize(("sign", "verdict"), [(1.0, "along"), (-1.0, "against")])
def test_a_push_moves_the_tip_as_its_stiffness_says(sign, verdict):
    device, rest, push = check(sign)
    assert rest.fault is None and rest.readings > 10 and rest.buttons == (2,) and max(rest.deviation) == 0.0
    assert push.force == pytest.approx(0.4, rel=0.02)
    # A force that rises evenly is followed a lag behind it, and by some polls.
    late = (Held.LAG + 2e-3) / RISE
    assert sign * push.moved == pytest.approx(0.4 / Held.STIFFNESS * (1.0 - late), rel=0.15)
    assert push.verdict == verdict and push.passed == (sign > 0)
    assert device.calls == ["open", "close"] and len(device.threads) == 1
    assert threading.current_thread() not in device.threads
    assert not device.written[-1][1].any(), "the last force is zero"


def test_it_is_polled_at_the_rate_of_the_loop_or_its_own():
    for rate, most in ((None, 1000.0), (200.0, 200.0)):
        device = Held()
        device.rate = rate
        with SelfCheck(device) as result:
            # Other programs may have the processors meanwhile: never faster, and the loop sees what was measured.
            assert 0.1 * most < result.watch(0.5).rate < 1.05 * most


def test_what_is_put_out_is_the_latest():
    class Loop:
        def __init__(self, force):
            self.force = force

        def wrench(self):
            return [self.force, 0.0, 0.0], [0.0] * 3, 0.0

    device = Held()
    polling = PollingThread(device, 1000.0)
    for force in (0.1, 0.2, 0.3):
        polling._write(Loop(force))
        assert device.written[-1][1][0] == force


class Failing(Held):
    """Goes wrong at its 200th reading, in a way that it is given."""

    def __init__(self, go_wrong):
        super().__init__()
        self.go_wrong, self.count, self.wrong_since = go_wrong, 0, None

    def read(self):
        self.count += 1
        if self.count >= 200:
            self.wrong_since = self.wrong_since or time.monotonic()
            return self.go_wrong()
        return super().read()


def raises():
    raise RuntimeError("the cable\nis out")


def reading(**given):
    return lambda: palpate.Reading(**{"position": (0, 0, 0), **given})


@pytest.mark.parametrize(
    ("go_wrong", "words"),
    [
        (raises, "Failing.read raised RuntimeError: the cable"),
        (reading(position=(0.0, math.nan, 0.0)), "position has a number that is not finite"),
        (reading(position=np.zeros(2)), "position needs three numbers, got 2"),
        (reading(position="here"), "position needs three numbers"),
        (reading(position=None), "position needs three numbers"),
        (reading(orientation=(1, 1, 0, 0)), "no unit quaternion: its length is 1.414"),
        (reading(orientation=(1, 0, 0)), "orientation has 3 numbers"),
        (reading(velocity=(math.inf, 0, 0)), "velocity has a number that is not finite"),
        (reading(buttons=-1), "buttons are -1"),
        (lambda: (0.0, 0.0, 0.0), "returned tuple, not a palpate.Reading"),
    ],
)
def test_a_reading_that_is_none_takes_the_force_away_and_is_told_in_one_line(go_wrong, words):
    with pytest.warns(palpate.DeviceWarning) as record:
        device, push = fault_of(lambda: Failing(go_wrong))
    assert push.verdict == "fault" and "the device's program has failed" in push.fault
    (warning,) = {str(one.message) for one in record}
    assert words in warning and "\n" not in warning and "Traceback" not in warning
    late = [when for when, force in device.written if force.any() and when > device.wrong_since + 0.1]
    assert not late and device.calls == ["open", "close"]


def test_a_read_that_hangs_takes_the_force_away_and_holds_nobody_up():
    released = threading.Event()
    device = Failing(lambda: (released.wait(20.0), palpate.Reading((0, 0, 0)))[1])
    with SelfCheck(device) as result:
        push = result.push("+x", 0.4, 10.0)
        silent = time.monotonic() - device.wrong_since
        assert push.verdict == "fault" and "stopped sending measurements" in push.fault
        assert 0.05 <= silent < 0.5
        released.set()
    assert not device.written[-1][1].any() and device.calls[-1] == "close"


def test_a_write_that_raises_is_a_fault_and_goes_on_being_tried():
    class Broken(Held):
        def write(self, force, torque):
            super().write(force, torque)
            if len(self.written) > 100:
                raise OSError("amplifier off")

    device = Broken()
    with (
        pytest.warns(palpate.DeviceWarning, match=r"Broken\.write raised OSError: amplifier off"),
        SelfCheck(device) as result,
    ):
        assert "program has failed" in result.watch(5.0).fault
        tried = len(device.written)
        time.sleep(0.35)
        # Twice each time, ten times a second: what was to be put out, and zero.
        assert 2 <= len(device.written) - tried <= 10
    assert device.calls == ["open", "close"]


def test_warnings_as_errors_do_not_end_the_thread():
    device = Failing(raises)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with SelfCheck(device) as result:
            assert result.push("+x", 0.4, 10.0).fault
    assert not device.written[-1][1].any() and device.calls[-1] == "close"


def test_a_device_that_does_not_open_says_why():
    class Shut(Held):
        def open(self):
            raise PermissionError(13, "Permission denied", "/dev/ttyACM0")

    device = Shut()
    with pytest.raises(palpate.DeviceError, match=r"Shut\.open raised PermissionError: .*Permission denied.*ttyACM0"):
        SelfCheck(device)
    assert device.calls == [], "what was not opened is not closed"
    with pytest.raises(palpate.DeviceError, match=r"Failing\.read raised RuntimeError"):
        failing = Failing(raises)
        failing.count = 200
        SelfCheck(failing)
    assert failing.calls == ["open", "close"]


def test_a_program_that_ends_without_a_word_leaves_no_force_behind():
    program = (
        "from held_device import Held\nfrom palpate.devices import SelfCheck\nimport time\n"
        "class Told(Held):\n    def close(self):\n        print('closed', abs(self.written[-1][1]).max())\n"
        "check = SelfCheck(Told())\ncheck.watch(0.3)\ncheck._check.begin((1.0, 0.0, 0.0), 0.4, 1.0)\ntime.sleep(0.5)\n"
        "print(check._program.written[-1][1].max() > 0.1)\n"
    )
    paths = os.pathsep.join([str(Path(__file__).parents[1]), *sys.path])
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, env={**os.environ, "PYTHONPATH": paths}, capture_output=True, text=True, timeout=60)
    assert done.stdout.split() == ["True", "closed", "0.0"], done.stderr


def test_a_tool_may_leave_the_scene():
    device = Held()
    device.read = lambda: None
    with SelfCheck(device) as result:
        rest, push = result.watch(0.2), result.push("+x", 0.4, 5.0)
    assert rest.readings == 0 and not rest.passed and rest.fault is None
    assert (push.force, push.fault) == (0.0, None)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: PollingThread(Held(), 20.0), "Held: rate must be 50 to 10000 Hz, got 20"),
        (lambda: palpate.DeviceLimits(max_force=-1.0), "max_force must be a number from zero on, got -1"),
        (lambda: palpate.DeviceLimits(max_stiffness=math.nan), "max_stiffness must be a number"),
        (lambda: palpate.DeviceLimits(delay=None), "delay must be a number"),
    ],
)
def test_what_cannot_be_is_refused(make, words):
    with pytest.raises(palpate.DeviceError, match=words):
        make()
