"""Results in files and in other libraries: what is read back is the field of theory, tensor by tensor."""

from __future__ import annotations

import os
import time

import matplotlib.figure
import meshio
import numpy as np
import pytest
import pyvista
from conftest import box_mesh, direct_solve

import palpate
from palpate.scene import BuiltScene
from palpate.simulation import BodyFrame, Frame

TOP = (0.04, 0.025, 0.05)
# Gradient of a displacement that is linear in the position, and so is exact in every element.
GRADIENT = 1e-3 * np.array([[1.0, 0.4, -0.2], [0.3, -0.5, 0.6], [0.1, -0.7, 0.8]])
ORDER = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)]


def linear_answer(green) -> palpate.Answer:
    """All of the surface, supports included, displaced by the gradient."""
    moved = green.surface_positions @ GRADIENT.T
    return green.solve(displacements={int(n): tuple(u) for n, u in zip(green.surface_nodes, moved, strict=True)})


def hooke(strain, modulus, ratio):
    lame = modulus * ratio / ((1 + ratio) * (1 - 2 * ratio))
    return lame * np.trace(strain) * np.eye(3) + modulus / (1 + ratio) * strain


@pytest.mark.parametrize("quadratic", [False, True])
@pytest.mark.parametrize("ending", [".vtu", ".vtk"])
def test_a_file_holds_the_fields_of_theory_at_all_nodes(quadratic, ending, tmp_path):
    mesh = box_mesh(cells=(3, 2, 2))
    mesh = mesh.to_quadratic() if quadratic else mesh
    body = palpate.Body(mesh, material=palpate.Material("10kPa", 0.3), fixed=lambda p: p[:, 0] < 1e-9)
    answer = linear_answer(palpate.precompute(body, precision="f64"))
    answer.write(tmp_path / f"x{ending}")
    assert sorted(os.listdir(tmp_path)) == ["cache", f"x{ending}"]
    read = meshio.read(tmp_path / f"x{ending}")
    assert np.allclose(read.points, mesh.nodes, rtol=0, atol=1e-15)
    assert np.array_equal(read.cells[0].data, mesh.tets) and len(read.cells) == 1
    scale = np.abs(GRADIENT).max()
    assert np.abs(read.point_data["displacement"] - mesh.nodes @ GRADIENT.T).max() < 1e-8 * scale
    strain = (GRADIENT + GRADIENT.T) / 2
    stress = hooke(strain, 10e3, 0.3)
    for name, tensor in (("strain", strain), ("stress", stress)):
        expected = [tensor[i, j] for i, j in ORDER]
        assert np.abs(read.point_data[name] - expected).max() < 1e-6 * np.abs(tensor).max()
    deviator = stress - np.trace(stress) / 3 * np.eye(3)
    assert read.point_data["von_mises"] == pytest.approx(np.sqrt(1.5 * (deviator**2).sum()), rel=1e-6)
    assert read.point_data["largest_strain"] == pytest.approx(np.abs(np.linalg.eigvalsh(strain)).max(), rel=1e-6)
    forces = np.zeros_like(mesh.nodes)
    forces[mesh.surface_nodes] = answer.forces
    assert np.allclose(read.point_data["force"], forces)


def test_the_inside_is_that_of_a_direct_solution(block, block_green):
    node = int(block_green.touchable_nodes[np.argmax(block_green.surface_positions[:, 2])])
    answer = block_green.solve(displacements={node: (0, 0, -1e-3)})
    known = {int(dof): 0.0 for dof in block.fixed_dofs} | {3 * node: 0.0, 3 * node + 1: 0.0, 3 * node + 2: -1e-3}
    direct, _ = direct_solve(block, known, np.zeros(block.fixed_mask.size))
    values = answer.to_meshio().point_data["displacement"]
    assert np.abs(values - direct).max() < 1e-8 * np.abs(direct).max()
    inner = np.setdiff1d(np.arange(len(direct)), block.mesh.surface_nodes)
    assert np.abs(direct[inner]).max() > 1e-5


def test_a_touch_goes_to_pyvista_and_into_a_picture(block, block_green, tmp_path):
    touch = block_green.touch(TOP, (0, 0, -2e-3), 5e-3)
    grid = touch.to_pyvista()
    assert isinstance(grid, pyvista.UnstructuredGrid) and grid.n_cells == len(block.mesh.tets)
    assert grid.volume == pytest.approx(block.mesh.volume)
    assert np.allclose(grid["displacement"][block.mesh.surface_nodes], touch.displacements)
    figure = touch.plot(magnification=3)
    assert isinstance(figure, matplotlib.figure.Figure) and "displacement" in figure.axes[1].get_ylabel()
    assert figure.axes[1].get_ylim()[1] == pytest.approx(1e3 * np.linalg.norm(touch.displacements, axis=1).max())
    figure.savefig(tmp_path / "touch.png")
    shown = touch._repr_html_()
    assert "Touch(force" in shown and "data:image/png;base64,iVBOR" in shown


def test_a_bare_store_gives_its_surface(block_green, tmp_path):
    store = palpate.GreensFunction.load(block_green.path)
    touch = store.touch(TOP, (0, 0, -2e-3), 5e-3)
    touch.write(tmp_path / "x.vtu")
    read = meshio.read(tmp_path / "x.vtu")
    assert set(read.point_data) == {"displacement", "largest_strain"}
    assert np.allclose(read.point_data["displacement"], touch.displacements)
    assert read.point_data["largest_strain"].max() > 0.01
    assert [block.type for block in read.cells] == ["triangle"]
    assert len(read.cells[0].data) == len(store.surface_triangles)


def frame_of(bodies, displacements, scales=None) -> Frame:
    values = tuple(
        BodyFrame(u, None, body.green, body, scale)
        for body, u, scale in zip(bodies, displacements, scales or [1.0] * len(bodies), strict=True)
    )
    zeros = np.zeros((1, 3))
    return Frame(
        0.0, zeros, zeros, zeros, np.array([[1.0, 0, 0, 0]]), np.array([True]), np.array([False]), [], values, {}
    )


def test_a_frame_stands_where_its_bodies_stand(block, block_green, tmp_path):
    turn = np.array([0.8, 0.0, 0.6, 0.0])
    scene = palpate.Scene(
        body={"store": "block.palpate", "position": ("1cm", 0, "-2cm"), "orientation": turn.tolist()},
        tool={"contact": "patch"},
    )
    placed = BuiltScene.of(scene, block, block_green).bodies[0]
    plain = BuiltScene.of(palpate.Scene(body={"store": "block.palpate"}), block, block_green).bodies[0]
    answer = linear_answer(block_green)
    store = palpate.GreensFunction.load(block_green.path)
    bare = BuiltScene.of(palpate.Scene(body={"store": "block.palpate"}), None, store).bodies[0]
    frame = frame_of([plain, placed, bare], [answer.displacements] * 3, [1.0, 2.0, 1.0])
    frame.write(tmp_path / "frame.vtu")
    read, count = meshio.read(tmp_path / "frame.vtu"), len(block.mesh.nodes)
    bodies = np.concatenate(read.cell_data["body"])
    assert np.bincount(bodies).tolist() == [len(block.mesh.tets)] * 2 + [len(store.surface_triangles)]
    rotation = np.array([[0.28, 0, 0.96], [0, 1, 0], [-0.96, 0, 0.28]])  # about y by twice the angle of (0.8, 0.6)
    mine, turned = slice(0, count), slice(count, 2 * count)
    assert np.allclose(read.points[turned], read.points[mine] @ rotation.T + [0.01, 0, -0.02])
    moved = read.point_data["displacement"]
    assert np.allclose(moved[turned], moved[mine] @ rotation.T)
    strain = (GRADIENT + GRADIENT.T) / 2
    stress = hooke(strain, 10e3, 0.4)
    expected = rotation @ strain @ rotation.T
    assert np.allclose(read.point_data["strain"][turned], [expected[i, j] for i, j in ORDER], atol=1e-9)
    expected = 2.0 * rotation @ stress @ rotation.T  # a body made twice as stiff while running
    assert np.allclose(read.point_data["stress"][turned], [expected[i, j] for i, j in ORDER], atol=1e-4)
    assert np.isnan(read.point_data["stress"][2 * count :]).all()
    assert np.isfinite(read.point_data["largest_strain"]).all()
    assert "Frame(" in frame._repr_html_() and len(frame.plot().axes[0].collections) == 3


def test_a_running_frame_is_written(block, block_green, tmp_path):
    scene = palpate.Scene(body={"store": "block.palpate"}, tool={"contact": "patch"})
    with palpate.Simulation(BuiltScene.of(scene, block, block_green)) as simulation:
        simulation.set_youngs_modulus("20kPa")
        # A frame has the stiffness of its tick.
        deadline = time.monotonic() + 60
        while (frame := simulation.frame()).bodies[0]._stiffness_scale == 1.0 and time.monotonic() < deadline:
            time.sleep(0.01)
    frame.write(tmp_path / "frame.vtu")
    assert len(meshio.read(tmp_path / "frame.vtu").points) == len(block.mesh.nodes)
    assert frame.bodies[0]._stiffness_scale == pytest.approx(2.0)


def test_what_cannot_be_written_is_refused_by_name(block_green, tmp_path):
    touch = block_green.touch(TOP, (0, 0, -1e-3), 5e-3)
    with pytest.raises(palpate.MeshError, match=r"x\.png: a result is written as \.vtu or \.vtk, got '\.png'"):
        touch.write(tmp_path / "x.png")
    with pytest.raises(palpate.MeshError, match="there is no folder"):
        touch.write(tmp_path / "nowhere" / "x.vtu")
