"""The largest strain as frames and answers tell it, and contacts whose displacement is limited by it."""

from __future__ import annotations

import time

import numpy as np
import pytest
from conftest import box_mesh

import palpate
from palpate.fields import StressRecovery, extreme_values, largest_magnitude
from palpate.scene import BuiltScene

TOP = np.array([0.041, 0.026, 0.05])
RADIUS, LIMIT = 0.006, 0.1
# The limit is watched at the places that matter most, which may miss some of the largest strain.
PLACES = 1.03


def built(body: palpate.Body, path, known: bool = True) -> BuiltScene:
    """Scene of a body, or of the bare store that is left of it."""
    green = palpate.precompute(body, precision="f64", path=path)
    scene = palpate.Scene(
        body={"store": str(path)},
        tool={"radius": RADIUS, "contact_radius": 0.012},
        device={"ramp": 0, "max_force": 100},
        view={"strain_limit": LIMIT},
    )
    return BuiltScene.of(scene, body, green) if known else scene.build()


@pytest.fixture(params=["elements", "surface", "loaded"])
def press(request, tmp_path):
    """A running simulation of a block: with its elements, from a bare store, and sagging under a load."""
    loads = palpate.Loads(gravity=(0, 0, -6.0)) if request.param == "loaded" else None
    material = palpate.Material(10e3, 0.4, 1000.0)
    body = palpate.Body(box_mesh((8, 5, 5)), material=material, fixed=lambda p: p[:, 2] < 1e-6, loads=loads)
    with palpate.Simulation(built(body, tmp_path / "block.palpate", request.param != "surface")) as simulation:
        yield simulation


def settle(simulation: palpate.Simulation, seconds: float = 60.0) -> palpate.Frame:
    """Frame once the simulated hand has arrived and the limit has been found."""
    end, before, same = time.monotonic() + seconds, None, 0
    while time.monotonic() < end:
        time.sleep(0.05)
        frame = simulation.frame()
        assert frame.statistics["fault"] is None
        now = np.concatenate([frame.positions.ravel(), frame.forces.ravel()])
        same = same + 1 if before is not None and np.abs(now - before).max() < 1e-8 else 0
        if same == 4:
            return frame
        before = now
    raise AssertionError(f"did not settle: {frame} {frame.contacts}")


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
    over = TOP + [0, 0, RADIUS]
    press.move(over - [0, 0, 0.001])
    shallow = settle(press)
    assert shallow.contacts and shallow.largest_strain < LIMIT
    assert not shallow.limited[0] and not shallow.contacts[0].limited
    press.move(over - [0.002, 0, 0.02])
    deep = settle(press)
    assert deep.limited[0] and deep.contacts[0].limited
    assert 0.995 * LIMIT <= deep.largest_strain <= PLACES * LIMIT
    press.move(over - [0.004, 0, 0.04])
    deeper = settle(press)
    # The force stays that of the closest admissible displacement, about the same whatever the depth.
    assert np.linalg.norm(deeper.forces[0]) == pytest.approx(np.linalg.norm(deep.forces[0]), rel=0.03)
    # A tool that moves back is not limited, and a tool that is lifted lets go.
    press.move(over - [0, 0, 0.001])
    back = settle(press)
    assert back.largest_strain < LIMIT and not back.limited[0]
    press.move(over + [0, 0, 0.01])
    lifted = settle(press)
    assert lifted.contacts == [] and not lifted.limited[0]


def test_a_pull_sideways_is_limited_too(press):
    surface = (
        TOP + press.green.free_displacements[np.argmin(np.linalg.norm(press.green.surface_positions - TOP, axis=1))]
    )
    press.move(surface)
    press.grab(True)
    settle(press)
    target = surface + [0.03, 0.0, 0.03]
    press.move(target)
    frame = settle(press)
    contact = frame.contacts[0]
    assert contact.mode == "grab" and contact.limited and frame.limited[0]
    assert 0.995 * LIMIT <= frame.largest_strain <= PLACES * LIMIT
    # The device goes where it is sent; the contact counts the closest displacement that is admissible.
    assert frame.positions[0] == pytest.approx(target, abs=1e-7)
    wanted = frame.positions[0] - contact.anchor
    assert 0 < contact.displacement @ wanted < 0.9 * wanted @ wanted


def test_other_settings_are_noticed(press):
    press.move(TOP + [0, 0, RADIUS - 0.03])
    first = settle(press).contacts[0]
    if press.youngs_modulus is not None:  # bodies with loads keep theirs
        press.set_youngs_modulus(2 * press.youngs_modulus)
        stiff = settle(press)
        assert stiff.contacts[0].force == pytest.approx(2 * first.force, rel=0.01)
        assert 0.995 * LIMIT <= stiff.largest_strain <= PLACES * LIMIT
    press.set_strain_limit(0.5 * LIMIT)
    halved = settle(press)
    assert halved.limited[0] and 0.4975 * LIMIT <= halved.largest_strain <= 0.5 * PLACES * LIMIT
    press.set_strain_limit(LIMIT)
    press.remove()
    time.sleep(0.05)
    press.set_radius(0.008)
    press.move(TOP + [0, 0, RADIUS - 0.03])
    smaller = settle(press)
    assert len(smaller.contacts[0].nodes) < len(first.nodes) and smaller.limited[0]
    assert 0.995 * LIMIT <= smaller.largest_strain <= PLACES * LIMIT


def test_without_a_limit_a_tool_goes_anywhere(press):
    press.set_strain_limit(0.0)
    press.move(TOP + [0, 0, RADIUS - 0.02])
    frame = settle(press)
    assert not frame.limited[0] and frame.largest_strain > LIMIT and not frame.within_linear_range
    assert frame.contacts[0].displacement == pytest.approx(frame.positions[0] - frame.contacts[0].anchor, abs=1e-12)


def test_a_limit_that_is_first_set_while_running_holds(tmp_path):
    body = palpate.Body(box_mesh((8, 5, 5)), material=palpate.Material(10e3, 0.4), fixed=lambda p: p[:, 2] < 1e-6)
    scene = built(body, tmp_path / "block.palpate")
    view = scene.scene.view.model_copy(update={"strain_limit": 0.0})
    scene = BuiltScene(scene.scene.model_copy(update={"view": view}), scene.bodies)
    with palpate.Simulation(scene) as simulation:
        simulation.move(TOP + [0, 0, RADIUS - 0.02])
        assert simulation.strain_limit == 0.0 and settle(simulation).largest_strain > 1.1 * LIMIT
        simulation.set_strain_limit(LIMIT)
        frame = settle(simulation)
        assert simulation.strain_limit == LIMIT
        assert frame.limited[0] and frame.largest_strain <= PLACES * LIMIT


@pytest.mark.parametrize("limit", [-0.1, 1.5, np.nan])
def test_a_limit_out_of_range_is_refused_while_running_too(press, limit):
    with pytest.raises(palpate.SceneError, match="limit of strain"):
        press.set_strain_limit(limit)


@pytest.mark.parametrize("value", ["-0.1", "1.5", "inf", "'much'"])
def test_a_limit_out_of_range_is_refused_with_its_line(tmp_path, value):
    (tmp_path / "a.toml").write_text(f'[body]\nmodel = "beam"\n[view]\nstrain_limit = {value}\n')
    with pytest.raises(palpate.SceneError, match=r"a.toml:4: view.strain_limit"):
        palpate.Scene.read(tmp_path / "a.toml")
