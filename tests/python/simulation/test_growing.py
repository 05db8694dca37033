"""Tools where nothing may be touched yet, and a loop that takes a larger store of its body."""

import shutil
import threading
import time
from contextlib import closing

import numpy as np
import pytest
from conftest import box_mesh, relative

import palpate
from palpate import _native
from palpate.green import BackgroundPrecompute

SIDE, RADIUS, DEPTH = 0.06, 0.006, 0.002
OUTSIDE = "the contact reaches outside the touch region"


@pytest.fixture(scope="module")
def body() -> palpate.Body:
    mesh = box_mesh((10, 10, 6), (SIDE, SIDE, SIDE), jitter=0.0)
    return palpate.Body(mesh, material=palpate.Material(20e3, 0.4), fixed=mesh.nodes[:, 2] < 1e-9)


@pytest.fixture(scope="module")
def stores(body, tmp_path_factory) -> tuple[palpate.GreensFunction, palpate.GreensFunction]:
    """Of the nodes with x above a quarter of the side, and of all."""
    folder = tmp_path_factory.mktemp("growing")
    part = palpate.precompute(body, precision="f16", touch="x > 1.3cm", path=folder / "part.palpate")
    return part, palpate.precompute(body, precision="f16", path=folder / "whole.palpate")


def loop_of(green: palpate.GreensFunction, tools: int = 1, contact: str = "local") -> palpate.Simulation:
    tool = {"radius": RADIUS, "contact": contact, "friction": 0.0}
    if contact == "patch":
        tool["contact_radius"] = 0.008
    scene = palpate.Scene(body={"store": str(green.path)}, tool=[tool] * tools, device={"priority": 0})
    return palpate.Simulation(scene)


def put(simulation, tool, x, depth):
    simulation.move((x, SIDE / 2, SIDE + RADIUS - depth), tool=tool)
    force = np.full(3, np.nan)
    for _ in range(100):
        time.sleep(0.1)
        frame, before = simulation.frame(), force
        assert frame.statistics["fault"] is None
        force = frame.forces[tool]
        if frame.time > 0.5 and np.abs(force - before).max() < 1e-9:
            return frame
    raise AssertionError("the force does not settle")


@pytest.mark.quick(2)
@pytest.mark.parametrize("contact", ["local", "patch"])
def test_a_tool_outside_feels_nothing_and_is_told(stores, contact):
    first, whole = stores
    with loop_of(first, contact=contact) as simulation:
        put(simulation, 0, 0.048, -0.02)
        frame = put(simulation, 0, 0.048, DEPTH)
        inside = frame.forces[0, 2]
        assert inside > 0.01 and frame.statistics["refused"] == [None]
        put(simulation, 0, 0.012, -0.02)
        frame = put(simulation, 0, 0.012, DEPTH)
        assert not frame.forces.any() and not frame.contacts
        assert frame.statistics["refused"] == [OUTSIDE]
        frame = put(simulation, 0, 0.012, -0.02)
        assert frame.statistics["refused"] == [None]
    with loop_of(whole, contact=contact) as simulation:
        put(simulation, 0, 0.048, -0.02)
        assert put(simulation, 0, 0.048, DEPTH).forces[0, 2] == pytest.approx(inside, rel=0.02)


def test_a_tool_outside_does_not_hold_up_another(stores):
    first, _ = stores
    with loop_of(first, tools=2) as simulation:
        put(simulation, 0, 0.012, -0.02)
        put(simulation, 1, 0.048, -0.02)
        put(simulation, 0, 0.012, DEPTH)
        shallow = put(simulation, 1, 0.048, 0.5 * DEPTH).forces[1, 2]
        deep = put(simulation, 1, 0.048, DEPTH).forces[1, 2]
        assert 0 < shallow < 0.6 * deep
        frame = put(simulation, 1, 0.048, -0.02)
        assert not frame.forces.any() and frame.statistics["refused"] == [OUTSIDE, None]


def test_sliding_in_from_outside_the_force_begins_at_zero(stores):
    first, _ = stores
    x = np.concatenate([np.full(50, 0.008), np.linspace(0.008, 0.05, 3000)])
    positions = np.column_stack([x, np.full(len(x), SIDE / 2), np.full(len(x), SIDE + RADIUS - DEPTH)])
    positions[0, 2] += 0.02
    with pytest.warns(palpate.TouchWarning, match="a tool reached a body without a force, first in tick"):
        forces = np.linalg.norm(loop_of(first).run(positions), axis=1)
    assert not forces[x < 0.02].any()
    assert forces.max() < 0.05, "a force has begun deep inside"


def test_a_running_loop_takes_a_larger_store(stores):
    first, whole = stores
    with loop_of(first) as simulation:
        put(simulation, 0, 0.054, -0.02)
        before = put(simulation, 0, 0.054, DEPTH)
        simulation.take_store(0, whole)
        after = put(simulation, 0, 0.054, DEPTH)
        assert after.statistics["fault"] is None and len(after.contacts) == 1
        assert relative(after.forces, before.forces) < 1e-6, "the contact did not go on"
        assert len(simulation.bodies[0].green.touchable_nodes) == len(whole.touchable_nodes)
        put(simulation, 0, 0.012, -0.02)
        frame = put(simulation, 0, 0.012, DEPTH)
        assert frame.forces[0, 2] > 0.01 and frame.statistics["refused"] == [None]
        with pytest.raises(palpate.Error, match="its surface differs"):
            simulation.take_store(0, palpate.precompute(other_body(), precision="f16"))
        assert len(simulation.bodies[0].green.touchable_nodes) == len(whole.touchable_nodes)


def other_body() -> palpate.Body:
    mesh = box_mesh((3, 3, 3), (SIDE, SIDE, SIDE), jitter=0.0)
    return palpate.Body(mesh, material=palpate.Material(20e3, 0.4), fixed=mesh.nodes[:, 2] < 1e-9)


def test_the_rest_is_computed_beside_the_loop_and_goes_on_another_time(tmp_path):
    mesh = box_mesh((7, 7, 5), (SIDE, SIDE, SIDE), jitter=0.0)
    body = palpate.Body(mesh, material=palpate.Material(20e3, 0.4), fixed=mesh.nodes[:, 2] < 1e-9)
    path = tmp_path / "a.palpate"
    with closing(BackgroundPrecompute(body, first="x > 5cm", precision="f32", path=path)) as background:
        first = background.wait()
        assert len(first.touchable_nodes) > 0
        background.yield_processor()
        surface = body.mesh.surface_nodes
        background.paint(surface[body.mesh.nodes[surface, 0] < 0.01])
    # It may have ended before it could say so.
    is_complete = len(palpate.GreensFunction.load(path).touchable_nodes) == len(surface)
    assert path.with_name("a.palpate.partial").exists() or is_complete
    with closing(BackgroundPrecompute(body, first="x > 5cm", precision="f32", path=path)) as background:
        assert len(background.wait().touchable_nodes) >= len(first.touchable_nodes)
        until = time.monotonic() + 60
        while not background.is_complete and time.monotonic() < until:
            assert background.error is None
            time.sleep(0.02)
        assert background.is_complete and background.done == background.columns and len(background.waiting) == 0
    assert len(palpate.precompute(body, precision="f32", path=path, progress=False).touchable_nodes) == len(surface)


@pytest.mark.slow
def test_a_store_that_another_process_computes_is_waited_for_and_its_stages_are_taken(tmp_path):
    mesh = box_mesh((7, 7, 5), (SIDE, SIDE, SIDE), jitter=0.0)
    body = palpate.Body(mesh, material=palpate.Material(20e3, 0.4), fixed=mesh.nodes[:, 2] < 1e-9)
    path, whole, part = (tmp_path / f"{name}.palpate" for name in "abc")
    surface = mesh.surface_nodes
    palpate.precompute(body, precision="f32", path=whole, progress=False)
    theirs = surface[mesh.nodes[surface, 0] < 0.03]
    palpate.precompute(body, precision="f32", touch=theirs, path=part, progress=False)
    held = _native.StoreClaim.take(path)
    with closing(BackgroundPrecompute(body, first="x > 5cm", precision="f32", path=path)) as background:
        # What the other process has ready can be touched here too.
        appear = threading.Timer(2.0, lambda: shutil.copy(part, tmp_path / "new") and (tmp_path / "new").rename(path))
        appear.start()
        with pytest.warns(palpate.StoreWarning, match=r"another process is computing .*a\.palpate: waiting for it"):
            first = background.wait()
        assert np.array_equal(first.touchable_nodes, theirs) and not background.is_complete
        shutil.copy(whole, tmp_path / "new")
        (tmp_path / "new").rename(path)
        held.release()
        until = time.monotonic() + 60
        while not background.is_complete and time.monotonic() < until:
            time.sleep(0.05)
        assert background.is_complete and background.error is None
        assert background.take().key == palpate.GreensFunction.load(whole).key
