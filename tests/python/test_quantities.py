"""Numbers with units at the API, and values of a wrong kind."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import box_mesh

import palpate
from palpate.units import count_text

TOP = (0.04, 0.025, 0.05)


def test_quantities_with_units_are_those_in_si(block_green):
    assert palpate.Material("10kPa", 0.4, "1.2g/cm3") == palpate.Material(10e3, 0.4, 1200.0)
    plain = block_green.touch(TOP, (None, None, -1e-3), 5e-3)
    assert block_green.touch(("4cm", "25mm", "0.05m"), (None, None, "-1mm"), "5mm") == plain
    node = int(block_green.touchable_nodes[-1])
    pressed = block_green.solve(forces={node: (0, 0, "-500mN")})
    assert pressed == block_green.solve(forces={node: (0, 0, -0.5)})
    moved = block_green.solve(displacements={node: (None, None, "-1mm")})
    assert moved == block_green.solve(displacements={node: (None, None, -1e-3)})
    loads = palpate.Loads(gravity=(0, 0, "-9.81m/s2"), pressure=[([1], "1kPa")], forces={3: (0, "1mN", 0)})
    assert loads == palpate.Loads(gravity=(0, 0, -9.81), pressure=[([1], 1e3)], forces={3: (0, 1e-3, 0)})
    assert palpate.shapes.Sphere(("1cm", 0, 0), "5mm").radius == 5e-3


def test_numbers_of_numpy_are_numbers():
    assert palpate.Material(np.float32(1e4), np.float64(0.4), np.int64(900)).youngs_modulus == 1e4


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda green: green.touch(TOP, (0, 0, -1e-3), radius="x"), "'x' is not a length"),
        (lambda green: green.touch(TOP, (0, 0, -1e-3), radius=None), "None is not a length"),
        (lambda green: green.touch(TOP, (0, 0, -1e-3), radius=[1]), r"\[1\] is not a length"),
        (lambda green: green.touch(TOP, (0, 0, "3 apples")), "displacement: unknown unit 'apples'"),
        (lambda green: green.touch("top", (0, 0, -1e-3)), "the touch point needs three numbers"),
        (lambda green: green.touch((10**400, 0, 0), (0, 0, 0)), "the touch point has a number that is not finite"),
        (lambda green: green.solve(forces=5), "forces must map nodes"),
        (lambda green: palpate.Material("10 apples", 0.4), "unknown unit 'apples'"),
        (lambda green: palpate.Material(None, 0.4), "needs a Young.s modulus"),
        (lambda green: palpate.Material(1e4, "soft"), "Poisson's ratio must be a finite number, got 'soft'"),
        (lambda green: palpate.Material(1e300, 0.4), r"Young's modulus must lie between .*, got 1e\+300 Pa"),
        (lambda green: palpate.Material(1e-300, 0.4), "Young's modulus must lie between .*, got 1e-300 Pa"),
        (lambda green: palpate.Body(box_mesh(), material="10kPa"), "material must be a palpate.Material"),
        (lambda green: palpate.Body(box_mesh(), material={0: 10e3}), "material of a region must be a palpate.Material"),
        (lambda green: palpate.Loads(gravity=(0, 0, "nan")), "'nan' is not an acceleration"),
        (lambda green: palpate.Simulation("block.toml"), "takes a palpate.Scene, got 'block.toml': Scene.read reads"),
        (lambda green: palpate.precompute("block"), "precompute takes a palpate.Body"),
        (lambda green: palpate.Loads(gravity="down"), "gravity needs three numbers"),
        (lambda green: palpate.Loads(pressure=200.0), "pressure takes pairs"),
        (lambda green: palpate.Loads(pressure=[([0], "much")]), "'much' is not a pressure"),
        (lambda green: palpate.Loads(forces=[1, 2, 3]), "forces must map nodes"),
        (lambda green: palpate.shapes.Sphere((0, 0, 0), "x"), "'x' is not a length"),
        (lambda green: palpate.tetrahedralize("examples/block.obj", "4 apples", unit="mm"), "unknown unit 'apples'"),
    ],
)
def test_values_of_a_wrong_kind_are_refused_by_name(call, message, block_green):
    with pytest.raises(palpate.Error, match=message) as raised:
        call(block_green)
    assert "\n" not in str(raised.value)


def test_a_single_thing_is_one():
    assert [count_text(n, "tool") for n in (0, 1, 2)] == ["0 tools", "1 tool", "2 tools"]
    assert [count_text(n, "body", "bodies") for n in (1, 3)] == ["1 body", "3 bodies"]


def test_settings_of_a_running_loop_take_units_and_refuse_the_rest(block, block_green):
    scene = palpate.Scene(body={"store": "block.palpate"}, tool={"contact": "patch"})
    simulation = palpate.Simulation(palpate.scene.BuiltScene.of(scene, block, block_green))
    simulation.set_radius("4mm")
    simulation.set_youngs_modulus("20kPa")
    assert simulation.contact_radius == 4e-3 and simulation.youngs_modulus == pytest.approx(20e3)
    for call in (
        lambda: simulation.set_radius("wide"),
        lambda: simulation.set_radius(-1),
        lambda: simulation.set_youngs_modulus("soft"),
        lambda: simulation.set_friction("rough"),
        lambda: simulation.set_strain_limit(None),
        lambda: simulation.run("up and down"),
        lambda: simulation.move("up"),
        lambda: simulation.move((0, 0, 1), tool="a"),
        lambda: simulation.stiffness_scale_of("a"),
    ):
        with pytest.raises(palpate.Error):
            call()
    assert simulation.contact_radius == 4e-3 and simulation.youngs_modulus == pytest.approx(20e3)
