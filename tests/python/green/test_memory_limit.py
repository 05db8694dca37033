"""A process that may not take much memory: a line of error, no abort."""

from __future__ import annotations

import subprocess
import sys

import pytest
from stored_columns import child_program

PROGRAM = """
from palpate.green import plan
green = palpate.precompute(body, precision="f32", path={path!r}) if {stored} else None
size = int(next(line for line in open("/proc/self/status") if line.startswith("VmSize")).split()[1]) * 1024
resource.setrlimit(resource.RLIMIT_AS, (size + {room}, resource.RLIM_INFINITY))
try:
    {work}
except palpate.Error as error:
    print(error)
"""
WORK = {
    "plan": "plan(body)",
    "precompute": "palpate.precompute(body, precision='f32', path={path!r})",
}


@pytest.mark.quick(2)
@pytest.mark.skipif(sys.platform != "linux", reason="limits of addresses are Linux's")
@pytest.mark.parametrize("what", WORK)
def test_scratch_that_the_system_does_not_give_is_a_line(what, tmp_path):
    """Twice the third level cache a thread: a machine with a small cache gives it."""
    path = str(tmp_path / "a.palpate")
    program = PROGRAM.format(path=path, stored=False, room=300_000_000, work=WORK[what].format(path=path))
    result = subprocess.run(
        [sys.executable, "-c", child_program((6, 5, 5), program)], capture_output=True, text=True, timeout=100
    )
    assert result.returncode == 0, result.stderr
    assert result.stdout == "" or result.stdout.startswith("products of matrices reserve "), result.stdout
    assert result.stdout.count("\n") <= 1


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="limits of addresses are Linux's")
def test_a_store_that_the_memory_cannot_hold_is_a_line(tmp_path):
    path = str(tmp_path / "a.palpate")
    program = PROGRAM.format(path=path, stored=True, room=10_000_000, work=f"palpate.GreensFunction.load({path!r})")
    result = subprocess.run(
        [sys.executable, "-c", child_program((20, 15, 15), program)], capture_output=True, text=True, timeout=100
    )
    assert result.returncode == 0, result.stderr
    assert result.stdout.startswith("the system does not give the 0.1 GB of memory"), result.stdout
