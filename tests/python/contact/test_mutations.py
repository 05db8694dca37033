"""Every check of contact fails when the law is wrong: what was measured is falsified, and judged as the table does.

The falsifications: force times 1.05, the wrong sign, forces of the tick before, and the compliance of exchanged axes.
`C_reg` is symmetric at a place, so that its transpose is itself. What an operator with its indices swapped does is done
three ways: by the Green's function of the block held at a side, whose compliances along and across the surface are
exchanged; by turning around the part of the force along the surface, which comes from the change of `C_reg`; and by
exchanging components of the force.

A uniform factor on all forces is another conservative law: closed paths do not see it, the direct solution does. They
see one that holds for a part of the surface.
"""

from __future__ import annotations

import numpy as np
import pytest

from palpate.body import Body
from palpate.validation.verify.benchmark import green_of, quiet_body
from palpate.validation.verify.contact import energy, measures, pressing, sliding
from palpate.validation.verify.contact.loop import loop_of, sphere
from palpate.validation.verify.contact.reference import body_on_table, sphere_press, top_nodes


def stale(forces: np.ndarray, axis: int = 0) -> np.ndarray:
    """Forces of the tick before."""
    late = np.roll(forces, 1, axis=axis)
    first = [slice(None)] * forces.ndim
    first[axis] = slice(0, 1)
    late[tuple(first)] = forces[tuple(first)]
    return late


def held_at_a_side(body: Body) -> Body:
    """Return the same mesh held where `x = 0` in place of `z = 0`."""
    return quiet_body(body.mesh, pressing.BLOCK.material, body.mesh.nodes[:, 0] < 1e-9)


@pytest.mark.slow
def test_a_force_five_per_cent_off_is_not_that_of_the_direct_solution():
    body = body_on_table(pressing.BLOCK, (10, 10, 5), quadratic=True)
    forces = pressed = pressing.pressed(body, np.array(pressing.DEPTHS))
    truth = np.array([sphere_press(pressing.BLOCK, pressing.RADIUS, depth).force for depth in pressing.DEPTHS])
    tolerances = np.array(pressing.TOLERANCES["10 nodes", 5.0])

    def passes(forces: np.ndarray) -> np.ndarray:
        return np.abs(forces / truth - 1) <= tolerances

    assert passes(forces).all()
    assert not passes(1.05 * pressed).any()
    assert not passes(-pressed).any()
    assert not passes(stale(pressed))[1:].any()
    exchanged = pressing.pressed(held_at_a_side(body), np.array(pressing.DEPTHS))
    assert not passes(exchanged).any()


@pytest.mark.slow
@pytest.mark.parametrize("make", [pressing.finger_pad, pressing.flat_punch])
def test_a_force_five_per_cent_off_is_not_that_of_the_shape(make):
    body, shape, depth = body_on_table(pressing.BLOCK, (10, 10, 5), quadratic=True), make(), 5e-4
    forces = pressing.pressed_shape(body, shape, np.linspace(1e-4, depth, 5))
    truth = pressing.direct(pressing.BLOCK, shape, depth)
    # Closer than all shapes of the table have to be.
    tolerance = 0.75 * pressing.TOLERANCE
    assert abs(forces[-1] / truth - 1) <= tolerance
    for wrong in (1.05 * forces, -forces, stale(forces)):
        assert abs(wrong[-1] / truth - 1) > tolerance


@pytest.mark.slow
def test_exponent_and_evenness_see_other_laws():
    depths = np.geomspace(1e-4, 1e-3, 9)
    hertz = depths**1.5
    assert abs(measures.exponent(depths, hertz) - 1.5) < 1e-12
    # A patch that sticks is a spring; Winkler's foundation goes with the square.
    for power in (1.0, 2.0):
        assert abs(measures.exponent(depths, depths**power) - 1.5) > 0.05

    simulation, body = sliding.flat_loop((10, 10, 5), quadratic=True)
    slide = sliding.flat_slide(simulation, body, length=0.01)
    assert measures.ripple(slide.forces) < 0.003
    # One place has the force of the tick before: of the last of the approach, a tenth of a millimetre higher.
    before = simulation.run(np.vstack([slide.points[:1] + (0, 0, h) for h in (2e-3, 1e-4 - sliding.DEPTH)]))
    late = stale(slide.forces)
    late[0] = before[-1]
    assert measures.ripple(late) > 0.003
    side = held_at_a_side(body)
    exchanged = loop_of(side, green_of(side, touch=top_nodes(side)), [sphere(sliding.RADIUS)])
    assert measures.ripple(sliding.flat_slide(exchanged, side, length=0.01).forces) > 0.003
    # 5 % more on one side of an element's edge, and a force that turns over.
    kinked = slide.forces * np.where(np.arange(len(slide.forces)) < 50, 1.05, 1.0)[:, None]
    assert measures.ripple(kinked) > 0.003
    # Forces ten times as large, so that 5 % of them are beyond the 5 mN that are allowed to all.
    assert measures.largest_jump(10 * kinked) > 1 >= measures.largest_jump(10 * slide.forces)
    turned = slide.forces * np.where(np.arange(len(slide.forces)) < 50, -1.0, 1.0)[:, None]
    assert measures.largest_jump(turned) > 1
    assert measures.attraction(turned, slide.normals) > 0
    along = slide.step * np.arange(2001)
    even = np.tile([0.0, 0.0, 0.1], (2001, 1))
    rough = even * (1 + 0.05 * (np.arange(2001) // 50 % 2))[:, None]  # elements of 5 mm, every other one 5 % harder
    assert measures.roughness(along[1], even)[0] < 1e-10  # rounding of the fit
    rms, largest = measures.roughness(along[1], rough)
    assert rms > 0.005
    assert largest > 0.02


@pytest.fixture(scope="module")
def bench():
    return energy.EnergyBench(body_on_table(energy.Block(), (6, 6, 3), quadratic=True))


@pytest.mark.slow
@pytest.mark.parametrize("tools", [1, 2])
def test_closed_paths_see_stale_turned_and_misdirected_forces(bench, tools):
    condition = energy.Condition(0.0, tools, moving=False, limited=False)
    paths = bench.paths(condition, 120)
    forces, torques = bench.played(condition, paths)

    def leak(forces: np.ndarray) -> float:
        return measures.leak(*measures.given_out(paths.positions, forces, paths.orientations, torques))

    assert leak(forces) <= energy.TOLERANCE
    assert leak(stale(forces, axis=1)) > energy.TOLERANCE
    # A conservative force stays so with the wrong sign; it draws the hand in.
    assert measures.attraction(forces, np.array([0.0, 0.0, 1.0])) == 0
    assert measures.attraction(-forces, np.array([0.0, 0.0, 1.0])) > 0
    # Without friction all force along the flat top comes from the change of C_reg.
    misdirected = forces * np.array([-1.0, -1.0, 1.0])
    assert leak(misdirected) > energy.TOLERANCE
    # 5 % more on one side of the middle, which every tool crosses.
    beyond = paths.positions[..., 1:2] > bench.body.mesh.bounds[:, 1].mean()
    assert leak(np.where(beyond, 1.05, 1.0) * forces) > energy.TOLERANCE


@pytest.mark.slow
def test_the_cone_and_mindlins_curve_see_wrong_friction():
    forces, normals = sliding.dragged(0.3, drags=10)
    assert measures.beyond_cone(forces, normals, 0.3) <= 1e-6
    assert measures.beyond_cone(forces * np.array([1.05, 1.05, 1.0]), normals, 0.3) > 1e-6
    touching = np.linalg.norm(forces, axis=1) > 0
    late = np.where(touching[:, None], np.column_stack([stale(forces)[:, :2], forces[:, 2]]), forces)
    assert measures.beyond_cone(late, normals, 0.3) > 1e-6
    assert measures.attraction(-forces, normals) > 0
    assert measures.beyond_cone(forces[:, ::-1], normals, 0.3) > 1e-6

    slip = sliding.partial_slip(0.3)
    assert slip.error <= sliding.PARTIAL_SLIP
    body = sliding.deep_block()
    side = quiet_body(body.mesh, sliding.DEEP.material, body.mesh.nodes[:, 0] < 1e-9)
    wrong = {
        "times 1.05": 1.05 * slip.forces,
        "wrong sign": -slip.forces,
        "stale": np.append(0.0, slip.forces[:-1]),
        "axes exchanged": sliding.partial_slip(0.3, side).forces,
    }
    for name, falsified in wrong.items():
        error = sliding.PartialSlip(slip.shifts, falsified, slip.exact, slip.limit).error
        assert error > sliding.PARTIAL_SLIP, f"{name}: {error}"


def test_the_balance_sees_all_of_them():
    forces, reactions, loads = energy.dragged()
    assert energy.imbalance(forces, reactions, loads) <= 1e-9
    wrong = {
        "times 1.05": 1.05 * forces,
        "wrong sign": -forces,
        "stale": stale(forces),
        "turned along the surface": forces * np.array([-1.0, 1.0, 1.0]),
    }
    for name, falsified in wrong.items():
        assert energy.imbalance(falsified, reactions, loads) > 1e-9, name
