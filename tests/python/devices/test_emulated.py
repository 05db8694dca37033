"""The drivers' devices are listed and checked, on emulated service and libraries."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest
from emulators import REST, inverse_service, library

# The libraries read what is plugged in when they are loaded: a process of its own.
PROGRAM = """
import json
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from palpate.devices import SelfCheck, listings

def checked(listing):
    (device,) = listing.found
    with SelfCheck(listing.kind, device.id) as check:
        rest, pushes = check.watch(0.4), [check.push(direction, 0.5, 0.5) for direction in ("+x", "-y", "+z")]
    return listing.kind, {
        "name": device.name, "obstacle": device.obstacle, "force": device.limits.max_force, "rest": asdict(rest),
        "passed": rest.passed, "verdicts": [push.verdict for push in pushes],
        "moved": [push.moved for push in pushes], "faults": [push.fault for push in pushes],
        "pushed": [push.force for push in pushes],
    }

# The checks wait for hands to move, all at the same time.
with ThreadPoolExecutor() as pool:
    print(json.dumps(dict(pool.map(checked, listings()))))
"""


@pytest.fixture(scope="module")
def checks():
    with inverse_service(REST) as (address, _):
        environment = {
            **os.environ,
            "PALPATE_HAPLY_ADDRESS": f"{address}&hold=50",
            "PALPATE_OPENHAPTICS_LIBRARY": library("hd"),
            "PALPATE_FORCEDIMENSION_LIBRARY": library("dhd"),
            "PALPATE_EMULATED_FORCEDIMENSION": "omega.3",
            "PALPATE_EMULATED_HAND": REST,
        }
        command = [sys.executable, "-c", PROGRAM]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.parametrize(
    ("kind", "name", "force"),
    [("haply", "Inverse3", 10.0), ("touch", "Touch", 3.3), ("forcedimension", "omega.3", 12.0)],
)
def test_a_device_is_found_and_pushes_where_it_should(checks, kind, name, force):
    found = checks[kind]
    assert name in found["name"] and found["obstacle"] is None and found["force"] == force
    assert found["faults"] == [None] * 3
    assert found["pushed"] == pytest.approx([0.5] * 3, rel=0.05)
    assert found["verdicts"] == ["along"] * 3, found["moved"]
    assert found["rest"]["readings"] > 50 and max(found["rest"]["deviation"]) < 1e-4
