"""palpate devices: what is found, why something is not, and a check that asks before any force."""

from __future__ import annotations

import json

import pytest
from command_line import refused, run
from held_device import Held, unstarved
from typer.testing import CliRunner

import palpate.devices
from palpate import DeviceLimits
from palpate.cli import devices as command
from palpate.cli.app import app
from palpate.devices import FoundDevice, Listing, Obstacle, SelfCheck

OBSTACLE = Obstacle("pad 8 is in use", "close the other program")
PADS = Listing(
    "pad",
    (
        FoundDevice("7", "Pad 3000", DeviceLimits(max_force=2.5, max_stiffness=400.0), None, {"firmware": "1.2"}),
        FoundDevice("8", "Pad 3000", DeviceLimits(), OBSTACLE, {}),
    ),
    None,
    {"library": "/opt/libpad.so"},
)
NONE = Listing("lever", (), Obstacle("no service listens at ws://localhost:1", "start it"), {})


@pytest.fixture
def pads(monkeypatch):
    """A machine with two pads, of which one can be opened, and a check that takes a second."""
    held = Held()

    def listings(which=None):
        return [listing for listing in (NONE, PADS) if which is None or listing.kind in which]

    monkeypatch.setattr(command, "listings", listings)
    monkeypatch.setattr(command, "usb_devices", list)
    monkeypatch.setattr(command, "SelfCheck", lambda kind, id: SelfCheck(held))
    monkeypatch.setattr(command, "is_terminal", lambda: True)
    for name, value in {"REST": 0.3, "RANGE": 0.2, "RANGE_UNATTENDED": 0.2, "RISE": 0.2, "RETURN": 0.1}.items():
        monkeypatch.setattr(command, name, value)
    # How fast a program is polled is the machine's affair.
    monkeypatch.setattr(palpate.devices.self_check, "LOWEST_RATE", 1.0)
    monkeypatch.setattr(palpate.devices.self_check, "LONGEST_GAP", 1.0)
    return held


def invoke(*words, answers=""):
    def attempt():
        result = CliRunner().invoke(app, ["devices", *words], input=answers)
        return result, result.output

    return unstarved(attempt)


def test_what_is_found_and_why_something_is_not(pads):
    result = invoke()
    assert result.exit_code == 0
    assert result.stdout.splitlines() == [
        "lever: none found",
        "  no service listens at ws://localhost:1",
        "  start it",
        "pad: 2 found (library /opt/libpad.so)",
        "  7  Pad 3000, at most 2.5 N, 400 N/m, firmware 1.2",
        "  8  Pad 3000, without limits of its own",
        "      cannot be opened: pad 8 is in use",
        "      close the other program",
    ]
    assert invoke("lever").exit_code == 1, "none that could be opened"


def test_the_list_as_json(pads):
    data = json.loads(invoke("--json").stdout)
    assert [kind["kind"] for kind in data["kinds"]] == ["lever", "pad"]
    pad = data["kinds"][1]["found"][0]
    assert (pad["id"], pad["limits"]["max_force"], pad["limits"]["max_torque"]) == ("7", 2.5, None)
    assert data["kinds"][0]["missing"] == {"what": "no service listens at ws://localhost:1", "advice": "start it"}


def test_a_check_asks_before_any_force(pads):
    result = invoke("--test", answers="\n\nq\n")
    assert result.exit_code == 0 and "not tried" in result.stdout
    assert "will push with up to 0.5 N" in result.stderr
    assert not any(force.any() for _, force in pads.written), "q is no force"


def test_a_check_pushes_along_every_axis_and_passes(pads):
    result = invoke("pad", "--test", answers="\n\n\n")
    assert result.exit_code == 0, result.output
    lines = [line for line in result.stdout.splitlines() if line.startswith("force")]
    assert [line.split()[1] for line in lines] == ["+x", "-x", "+y", "-y", "+z", "-z"]
    assert all("along it" in line for line in lines)
    moved = [float(line.split("moved")[1].split()[0]) for line in lines]
    assert max(moved) - min(moved) < 0.2, "each begins where the tip has come back to"
    assert "to the right" in lines[0] and "towards you" in lines[3] and "down" in lines[5]
    assert result.stdout.splitlines()[-1] == "check: passed"
    assert max(abs(force).max() for _, force in pads.written) == pytest.approx(0.4, rel=0.02), "the device's own limit"


def test_a_wrong_sign_fails_the_check(pads):
    pads.sign = -1.0
    result = invoke("--test", "--yes", "--json")
    data = json.loads(result.stdout)
    assert result.exit_code == 1 and not data["passed"]
    assert {push["verdict"] for push in data["pushes"]} == {"against"}
    assert data["limits"]["max_force"] == 0.4 and data["rest"]["passed"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("lever", "--test", "--yes"), "lever: no service listens at ws://localhost:1: start it"),
        (("--test", "--yes", "--id", "9"), "there is no '9'; 'palpate devices' lists the devices that were found"),
    ],
)
def test_what_cannot_be_checked_is_one_line(pads, words, message):
    assert str(invoke(*words).exception) == message


def test_without_a_terminal_nothing_is_pushed(pads, monkeypatch):
    monkeypatch.setattr(command, "is_terminal", lambda: False)
    assert "give --yes" in str(invoke("--test").exception)
    assert pads.calls == []


def test_what_the_drivers_themselves_say_where_nothing_is(tmp_path, monkeypatch):
    assert "choose among haply, touch, forcedimension" in str(invoke("joystick").exception)
    # Nobody listens there, and there are no such files.
    monkeypatch.setenv("PALPATE_HAPLY_ADDRESS", "ws://127.0.0.1:9")
    for name in ("OPENHAPTICS", "FORCEDIMENSION"):
        monkeypatch.setenv(f"PALPATE_{name}_LIBRARY", str(tmp_path / f"lib{name}.so"))
    result = invoke("--json")
    assert result.exit_code == 1
    haply, touch, forcedimension = json.loads(result.stdout)["kinds"]
    assert haply["found"] == [] and "ws://127.0.0.1:9" in haply["missing"]["what"]
    assert str(tmp_path / "libOPENHAPTICS.so") in touch["missing"]["what"]
    assert str(tmp_path / "libFORCEDIMENSION.so") in forcedimension["missing"]["what"]


def test_a_mistake_is_one_line(tmp_path):
    refused(run("devices", "joystick", cwd=tmp_path), "joystick", "haply, touch, forcedimension")
