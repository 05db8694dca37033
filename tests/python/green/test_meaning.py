"""Answers that mean nothing are refused or warned of: lengths in another unit, presses beyond the strain limit."""

from __future__ import annotations

import time
import warnings

import numpy as np
import pytest
from command_line import refused, run

import palpate

TOP = (0.04, 0.025, 0.05)


def test_a_point_off_the_surface_is_refused_unless_it_is_meant(block_green):
    press = (None, None, -1e-3)
    with pytest.raises(
        palpate.BodyError, match=r"^the touch point lies 68\.\d+ m from the surface[^\n]*on_surface=False"
    ):
        block_green.touch((40.0, 25.0, 50.0), press, 0.005)
    beside = (0.04, 0.025, 0.056)
    with pytest.raises(palpate.BodyError, match="lies 6 mm from the surface of the body, which is 80 x 50 x 50 mm"):
        block_green.touch(beside, press, 0.005)
    meant = block_green.touch(beside, press, 0.005, on_surface=False)
    assert np.array_equal(meant.force, block_green.touch(TOP, press, 0.005).force)
    assert meant.distance == pytest.approx(0.006, rel=1e-6)
    # Within the radius the closest point is taken as before.
    block_green.touch((0.04, 0.025, 0.054), press, 0.005)


def test_a_press_beyond_the_strain_limit_is_warned_of(block_green):
    with pytest.warns(palpate.TouchWarning, match=r"strains the surface by \d+ %, beyond the limit of 30 %"):
        deep = block_green.touch(TOP, (None, None, -0.03), 0.005)
    assert deep.largest_strain > 0.3
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        shallow = block_green.touch(TOP, (None, None, -5e-4), 0.005)
    assert shallow.largest_strain < 0.3


@pytest.mark.parametrize(("gravity", "crushes"), [(-9.81, False), (-200.0, True)])
def test_loads_beyond_the_strain_limit_are_warned_of(block, tmp_path, gravity, crushes):
    """A column of length L under its own weight: the strain at its support is rho g L / E, 0.08 and 1.6 here."""
    body = palpate.Body(
        block.mesh, material=block.material, fixed=block.fixed_nodes, loads=palpate.Loads(gravity=(gravity, 0, 0))
    )
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for _ in ("computed", "read"):
            palpate.precompute(body, path=tmp_path / "block.palpate", progress=False)
    texts = [str(one.message) for one in caught if one.category is palpate.TouchWarning]
    assert len(texts) == 2 * crushes and all("the body's own loads strain its surface by" in text for text in texts)


def test_a_contact_radius_larger_than_the_body_is_refused(block_green):
    with pytest.raises(palpate.BodyError, match=r"contact radius of 5 m is larger than the body, which is 80 x 50"):
        block_green.touch(TOP, (None, None, -1e-3), 5.0)


def test_the_command_refuses_them_too(block_green, tmp_path):
    block_green.save(tmp_path / "block.palpate")

    def touched(point: str, press: str):
        return run("touch", "block.palpate", f"--point={point}", f"--press={press}", "--radius=5mm", cwd=tmp_path)

    refused(touched("40,25,50", "-,-,-1mm"), "m from the surface")
    deep = touched("40mm,25mm,50mm", "-,-,-30mm")
    assert deep.returncode == 1 and "beyond the limit of 30 %" in deep.stderr and "Traceback" not in deep.stderr
    assert touched("40mm,25mm,50mm", "-,-,-0.5mm").returncode == 0


def test_gravity_in_another_unit_is_refused(tmp_path):
    with pytest.raises(palpate.BodyError, match=r"^gravity of 981 m/s\^2 is 100 times that of the earth[^\n]*$"):
        palpate.Loads(gravity=(0, 0, -981))
    assert palpate.Loads(gravity=(0, 0, "-9.81m/s^2")).gravity[2] == pytest.approx(-9.81)
    (tmp_path / "scene.toml").write_text('[body]\nmodel = "beam"\n[[loads]]\ngravity = [0, 0, -981]\n')
    with pytest.raises(palpate.SceneError, match=r"scene\.toml:3.*100 times that of the earth"):
        palpate.Scene.read(tmp_path / "scene.toml")


@pytest.mark.parametrize(
    ("tool", "words"),
    [
        ({"radius": 6.0}, r"^tool\.radius is 6 m, more than the longest side of the bodies, 80 mm"),
        ({"radius": 6e-6}, r"^tool\.radius is 6e-06 m, less than a hundredth of an element"),
        ({"shape": "ellipsoid", "semi_axes": (6.0, 8.0, 6.0)}, r"^tool\.semi_axes is 8 m"),
        ({"shape": "capsule", "radius": 3e-3, "length": 18.0}, r"^tool\.length is 18 m"),
    ],
)
def test_a_tool_in_another_unit_is_refused_by_name(block, block_green, tool, words):
    scene = palpate.Scene(body={"model": "beam"}, tool=tool)
    with pytest.raises(palpate.SceneError, match=words):
        palpate.scene.BuiltScene.of(scene, block, block_green)


def test_a_pose_beyond_the_strain_limit_is_warned_of_in_python(block, block_green):
    tool = {"radius": 0.006, "friction": 0.0}
    scene = palpate.Scene(body={"model": "beam"}, tool=tool, view={"strain_limit": 0.05})
    simulation = palpate.Simulation(palpate.scene.BuiltScene.of(scene, block, block_green))

    def pressed(depth: float) -> np.ndarray:
        return np.array(TOP) + [0, 0, 0.006] - np.outer(np.linspace(-1e-3, depth, 400), [0, 0, 1])

    for run_path in (simulation.run, simulation.play):
        with pytest.warns(palpate.TouchWarning, match=r"first in tick \d+, a tool was held at the strain limit of 5 %"):
            run_path(pressed(0.01))
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            run_path(pressed(5e-4))
    with simulation:
        simulation.move(pressed(0.01)[-1])
        with pytest.warns(palpate.TouchWarning, match=r"^a tool was held at the strain limit of 5 %"):
            time.sleep(1.0)
            simulation.frame()
        with warnings.catch_warnings():
            # Once is enough.
            warnings.simplefilter("error")
            simulation.frame()
