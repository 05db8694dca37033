"""The largest strain as frames and answers tell it, and a tool whose displacement is limited by it."""

from __future__ import annotations

import time

import numpy as np
import pytest
from conftest import box_mesh

import palpate
from palpate.fields import StressRecovery, extreme_values, largest_magnitude
from palpate.scene import BuiltScene
from palpate.simulation import LimitedTool

TOP = np.array([0.041, 0.026, 0.05])
RADIUS, LIMIT = 0.006, 0.1


def built(body: palpate.Body, path, known: bool = True) -> BuiltScene:
    """Scene of a body, or of the bare store that is left of it."""
    green = palpate.precompute(body, precision="f64", path=path)
    scene = palpate.Scene(
        body={"store": str(path)},
        tool={"radius": RADIUS, "contact_radius": 0.012},
        device={"ramp": 0, "max_force": 100},
    )
    return BuiltScene(scene, body, green) if known else scene.build()


@pytest.fixture(params=["elements", "surface", "loaded"])
def press(request, tmp_path):
    """A running simulation of a block: with its elements, from a bare store, and sagging under a load."""
    loads = palpate.Loads(gravity=(0, 0, -6.0)) if request.param == "loaded" else None
    material = palpate.Material(10e3, 0.4, 1000.0)
    body = palpate.Body(box_mesh((8, 5, 5)), material=material, fixed=lambda p: p[:, 2] < 1e-6, loads=loads)
    with palpate.Simulation(built(body, tmp_path / "block.palpate", request.param != "surface")) as simulation:
        yield simulation


def settle(tool: LimitedTool, simulation: palpate.Simulation) -> palpate.Frame:
    """Frame once the simulated hand has arrived."""
    for _ in range(12):
        tool.update()
        time.sleep(0.01)
    return simulation.frame()


def test_extreme_principal_values_are_those_of_lapack():
    tensors = np.random.default_rng(1).normal(size=(500, 3, 3))
    tensors[:100] *= np.eye(3)
    tensors[0] = tensors[1, 0, 0] * np.eye(3)
    tensors += np.swapaxes(tensors, 1, 2)
    values = np.linalg.eigvalsh(tensors)
    high, low = extreme_values(tensors)
    assert np.abs(high - values[:, 2]).max() < 1e-7 and np.abs(low - values[:, 0]).max() < 1e-7
    assert largest_magnitude(np.zeros((1, 3, 3))).tolist() == [0.0]


def test_answers_and_frames_know_their_largest_strain(block, block_green, tmp_path):
    touch = block_green.touch(TOP, (None, None, -0.002), 0.012)
    recovered = StressRecovery(block).recover(touch.displacements)
    assert touch.largest_strain == pytest.approx(np.abs(recovered.principal_strains).max(), rel=1e-6)
    assert touch.within_linear_range
    assert not block_green.touch(TOP, (None, None, -0.02), 0.012).within_linear_range
    node = int(block_green.touchable_nodes[-1])
    assert block_green.solve(forces={node: (0.01, 0, 0)}).largest_strain > 0
    # A bare store answers by its surface.
    block_green.save(tmp_path / "bare.palpate")
    bare = palpate.GreensFunction.load(tmp_path / "bare.palpate").touch(TOP, (None, None, -0.002), 0.012)
    assert 0 < bare.largest_strain != touch.largest_strain


def test_a_deep_press_stops_at_the_limit(press):
    tool = LimitedTool(press, LIMIT)
    over = TOP + [0, 0, RADIUS]
    tool.move(over - [0, 0, 0.001])
    shallow = settle(tool, press)
    assert not tool.limited and shallow.largest_strain < LIMIT
    tool.move(over - [0.002, 0, 0.02])
    deep = settle(tool, press)
    assert tool.limited
    assert 0.995 * LIMIT <= deep.largest_strain <= 1.0001 * LIMIT
    tool.move(over - [0.004, 0, 0.04])
    deeper = settle(tool, press)
    assert deeper.forces[0] == pytest.approx(deep.forces[0], abs=0.01 * np.linalg.norm(deep.forces[0]))
    # A tool that moves back is not limited, and a tool that is lifted lets go.
    tool.move(over - [0, 0, 0.001])
    assert settle(tool, press).largest_strain < LIMIT and not tool.limited
    tool.move(over + [0, 0, 0.01])
    assert settle(tool, press).contacts == [] and not tool.limited


def test_a_pull_sideways_is_limited_too(press):
    tool = LimitedTool(press, LIMIT)
    surface = (
        TOP + press.green.free_displacements[np.argmin(np.linalg.norm(press.green.surface_positions - TOP, axis=1))]
    )
    tool.move(surface)
    press.grab(True)
    settle(tool, press)
    tool.move(surface + [0.03, 0.0, 0.03])
    frame = settle(tool, press)
    assert frame.contacts[0].mode == "grab" and tool.limited
    assert frame.largest_strain == pytest.approx(LIMIT, rel=0.005)
    displacement = frame.positions[0] - frame.contacts[0].anchor
    assert np.cross(displacement, tool.wanted - frame.contacts[0].anchor) == pytest.approx(np.zeros(3), abs=1e-8)


def test_the_response_is_that_of_a_touch(press):
    press.move(TOP + [0, 0, RADIUS - 0.001])
    time.sleep(0.1)
    contact, response = press.contact_response()
    frame = press.frame()
    displacement = frame.positions[0] - contact.anchor
    expected = press.green.free_displacements + np.tensordot(displacement, response, axes=1)
    assert np.abs(frame.displacements - expected).max() <= 1e-9 * np.abs(expected).max()
    press.remove()
    time.sleep(0.05)
    assert press.contact_response() is None and press.contacts() == []


def test_other_settings_are_noticed(press):
    tool = LimitedTool(press, LIMIT)
    tool.move(TOP + [0, 0, RADIUS - 0.03])
    first = settle(tool, press).contacts[0]
    if press.youngs_modulus is not None:  # bodies with loads keep theirs
        press.set_youngs_modulus(2 * press.youngs_modulus)
        stiff = settle(tool, press)
        assert stiff.contacts[0].force == pytest.approx(2 * first.force, rel=0.01)
        assert stiff.largest_strain == pytest.approx(LIMIT, rel=0.005)
    tool.remove()
    time.sleep(0.05)
    press.set_radius(0.008)
    tool.move(TOP + [0, 0, RADIUS - 0.03])
    smaller = settle(tool, press)
    assert len(smaller.contacts[0].nodes) < len(first.nodes) and tool.limited
    assert smaller.largest_strain == pytest.approx(LIMIT, rel=0.005)


def test_without_a_limit_a_tool_goes_anywhere(press):
    tool = LimitedTool(press, 0.0)
    tool.move(TOP + [0, 0, RADIUS - 0.02])
    frame = settle(tool, press)
    assert not tool.limited and frame.largest_strain > LIMIT and not frame.within_linear_range


@pytest.mark.parametrize("value", ["-0.1", "1.5", "inf", "'much'"])
def test_a_limit_out_of_range_is_refused_with_its_line(tmp_path, value):
    (tmp_path / "a.toml").write_text(f'[body]\nmodel = "beam"\n[view]\nstrain_limit = {value}\n')
    with pytest.raises(palpate.SceneError, match=r"a.toml:4: view.strain_limit"):
        palpate.Scene.read(tmp_path / "a.toml")


def test_the_former_name_of_the_limit_is_refused_with_the_new_one(tmp_path):
    (tmp_path / "a.toml").write_text('[body]\nmodel = "beam"\n[view]\nhold_strain = 0.1\n')
    with pytest.raises(palpate.SceneError, match=r"a.toml:4: .*'view.hold_strain'; did you mean 'strain_limit'"):
        palpate.Scene.read(tmp_path / "a.toml")
