"""A scripted press from the command line: what its log holds, and what Ctrl-C leaves of it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from command_line import run

import palpate
from palpate.cli import scripted
from palpate.validation.verify.contact import groove

SCENE = '[body]\nmodel = "kidney"\npaper = true\n[tool]\ncontact = "patch"\ncontact_radius = "6mm"\n'


def read_log(path):
    return np.genfromtxt(path, delimiter=",", names=True)


@pytest.mark.slow
def test_the_log_has_the_depth_and_the_strain_of_every_tick(tmp_path):
    """Of a patch that sticks both are proportional to the force: of one answer of the Green's function, scaled."""
    (tmp_path / "a.toml").write_text(SCENE + "[view]\nstrain_limit = 0\n")
    assert run("run", "a.toml", "--headless", "2", cwd=tmp_path).returncode == 0
    log = read_log(tmp_path / "a.csv")
    held = (log["time_s"] > 0.8) & (log["time_s"] < 1.2)
    green = palpate.Scene.read(tmp_path / "a.toml").build(progress=False).bodies[0].green
    depth = log["depth_m"][held].mean()
    assert depth == pytest.approx(0.03 * np.ptp(green.surface_positions, axis=0).max(), rel=0.02)
    top = [log[name][held].mean() for name in ("x_m", "y_m")]
    high = green.surface_positions[:, 2].max()
    touch = green.touch((*top, high), (0, 0, -depth), 6e-3)
    assert log["fz_N"][held].mean() == pytest.approx(-touch.force[2], rel=0.03)
    assert log["strain"][held].mean() == pytest.approx(touch.largest_strain, rel=0.05)
    assert log["depth_m"][0] == log["strain"][0] == 0


@pytest.mark.slow
def test_the_log_is_kept_on_ctrl_c(tmp_path):
    (tmp_path / "a.toml").write_text(SCENE)
    # What starts tests in the background ignores SIGINT, and what is ignored is inherited.
    program = (
        "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "import palpate.cli.scripted as scripted\n"
        "class Told(scripted.Simulation):\n"
        "    def start(self):\n"
        "        super().start()\n"
        "        print('running', flush=True)\n"
        "scripted.Simulation = Told\n"
        "from palpate.cli import main; main()\n"
    )
    command = [sys.executable, "-c", program, "run", "a.toml", "--headless", "60"]
    child = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    # The plan and the place in the cache come first.
    assert "running\n" in [child.stdout.readline() for _ in range(3)]
    time.sleep(1.5)
    child.send_signal(signal.SIGINT)
    output, complained = child.communicate(timeout=280)
    assert child.returncode == 130, complained
    assert complained.strip().splitlines()[-1] == "palpate: interrupted" and "Traceback" not in complained
    assert complained.count("interrupted") == 1
    assert "wrote a.csv and .png" in output
    assert sorted(os.listdir(tmp_path)) == ["a.csv", "a.png", "a.toml", "cache"]
    log = read_log(tmp_path / "a.csv")
    assert 1.0 < log["time_s"][-1] < 20 and len(log) > 500


@pytest.mark.slow
def test_the_depth_in_a_groove_is_that_of_the_wall_that_is_pressed_farther():
    """Between walls at 45 degrees a sphere beside the middle, by s, is as much deeper in one: (d + |s|) / sqrt(2)."""
    down, aside = 1e-3, 0.4e-3
    expected = pytest.approx((down + aside) / np.sqrt(2), rel=0.03)
    with groove.grooved_loop() as simulation:
        # The wall that is left behind was touched first.
        for place in (-aside, aside):
            simulation.move(np.array([place, 0.0, groove.TOUCHES]) + down * groove.DOWN)
            # The device is there within some hundredths of a second.
            time.sleep(1.0)
            frame = simulation.frame()
            assert scripted.depth_of_first_tool(frame) == expected
    assert len(frame.contacts) == 2
