"""10-node tetrahedra from the scene file to the force, the strain and the viewer's messages."""

from __future__ import annotations

import command_line
import numpy as np
import pytest
from conftest import bent, box_mesh
from viewer_client import frame_of

import palpate
from palpate.fields import SurfaceStrain
from palpate.viewer.fields import ClientView
from palpate.viewer.messages import decode
from palpate.viewer.session import Session

RADIUS, PATCH = 0.006, 0.012
TOP = np.array([0.041, 0.026, 0.05])
SCENE = f"""
[body]
mesh = "block.vtu"
precision = "f64"
ELEMENT
[material]
poissons_ratio = 0.45
[supports]
fixed = FIXED
[tool]
radius = {RADIUS}
contact_radius = {PATCH}
[device]
max_force = 100
max_slew = 1e9
ramp = 0
[view]
strain_limit = 0
"""


def scene(folder, mesh, element='element = "quadratic"', fixed='"z < 1e-6"'):
    mesh.write(folder / "block.vtu")
    (folder / "block.toml").write_text(SCENE.replace("ELEMENT", element).replace("FIXED", fixed))
    return palpate.Scene.read(folder / "block.toml")


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        return scene(tmp_path_factory.mktemp("scene"), box_mesh(cells=(5, 4, 4), jitter=0.1)).build()


def test_force_on_the_device_is_the_touch(built):
    mesh = built.bodies[0].body.mesh
    assert mesh.is_quadratic
    assert np.isin(mesh.surface_nodes[mesh.nodes[mesh.surface_nodes, 2] < 1e-6], built.bodies[0].body.fixed_nodes).all()
    depth = np.linspace(1e-3, -2e-3, 50)[:, None]
    forces = palpate.Simulation(built).run(TOP + (RADIUS + depth) * [0, 0, 1])
    expected = built.bodies[0].green.touch(TOP, (0, 0, -2e-3), PATCH).force
    assert forces[-1] == pytest.approx(-expected, rel=1e-2, abs=1e-3)
    assert forces[-1, 2] > 0.05


def test_quadratic_elements_are_softer_at_the_same_contact(built, tmp_path):
    """Both are upper bounds of the stiffness; the one with more freedom is nearer."""
    linear = scene(tmp_path, box_mesh(cells=(5, 4, 4), jitter=0.1), element="").build()
    assert not linear.bodies[0].body.mesh.is_quadratic
    force = [b.bodies[0].green.touch(TOP, (0, 0, -2e-3), PATCH).force[2] for b in (built, linear)]
    assert -force[1] > -1.1 * force[0] > 0


def test_listed_supports_hold_the_nodes_between_them(tmp_path):
    mesh = box_mesh(cells=(3, 2, 2))
    listed = np.flatnonzero(mesh.nodes[:, 2] < 1e-9).tolist()
    body = scene(tmp_path, mesh, fixed=str(listed)).build().bodies[0].body
    assert np.array_equal(body.fixed_nodes, np.flatnonzero(body.mesh.nodes[:, 2] < 1e-9))
    with pytest.raises(palpate.BodyError, match="fixed node 100000 does not exist"):
        scene(tmp_path, mesh, fixed="[0, 100000]").build()


def test_second_order_files_are_taken_as_they_are(tmp_path):
    curved = bent(box_mesh(cells=(3, 2, 2)).to_quadratic())
    for element in ("", 'element = "quadratic"'):
        assert np.array_equal(
            scene(tmp_path, curved, element, '"x < 1e-2"').build().bodies[0].body.mesh.tets, curved.tets
        )
    with pytest.raises(palpate.SceneError, match=r"block\.vtu holds 10-node tetrahedra: leave out body.element"):
        scene(tmp_path, curved, 'element = "linear"').build()
    with pytest.raises(palpate.SceneError, match=r"block\.toml:5: body.element"):
        scene(tmp_path, curved, 'element = "cubic"')


def test_strain_of_a_quadratic_displacement_is_exact():
    """`u_x = c x^2` stretches by `E = 2 c x + 2 c^2 x^2` on the faces along x, most at the far end."""
    mesh = box_mesh(cells=(3, 2, 2)).to_quadratic()
    x = mesh.nodes[mesh.surface_nodes]
    faces = np.searchsorted(mesh.surface_nodes, mesh.surface_faces)
    strain = SurfaceStrain(x, faces)
    stretch, end = 2.0, 0.08
    u = np.zeros_like(x)
    u[:, 0] = stretch * x[:, 0] ** 2
    # At the end's edges half of the faces lie across x and are not stretched; half an element before, all count.
    exact = lambda at: 2 * stretch * at + 2 * (stretch * at) ** 2  # noqa: E731
    assert exact(end - end / 6) * (1 - 1e-12) <= strain.largest(u) <= exact(end) * (1 + 1e-12)


def test_strain_on_curved_faces():
    """An even stretch by s is `E = s + s^2 / 2` everywhere, and a rotation is none."""
    mesh = bent(box_mesh(cells=(3, 2, 2)).to_quadratic())
    x = mesh.nodes[mesh.surface_nodes]
    strain = SurfaceStrain(x, np.searchsorted(mesh.surface_nodes, mesh.surface_faces))
    assert strain.largest(0.03 * x) == pytest.approx(0.03 + 0.03**2 / 2, rel=1e-9)
    turn = np.array([[0.6, -0.8, 0], [0.8, 0.6, 0], [0, 0, 1]])
    assert strain.largest(x @ turn.T - x) <= 1e-12


def test_viewer_is_sent_flat_triangles_and_tets(built):
    session = Session(built)
    session.start()
    try:
        header, arrays = decode(session.scene_message())
        mesh = built.bodies[0].body.mesh
        assert [body["tets"] for body in header["bodies"]] == [len(mesh.tets)]
        assert arrays["0/tets"].shape == (8 * len(mesh.tets), 4)
        assert np.array_equal(np.unique(arrays["0/tets"]), np.arange(len(mesh.nodes)))
        assert np.array_equal(arrays["0/surface_triangles"], mesh.surface_triangles)
        header, arrays = frame_of(session, ClientView(cutaway=True))
        assert arrays["0/displacements"].shape == (len(mesh.nodes), 3)
        assert header["strain"] <= 1e-12
    finally:
        session.close()


@pytest.mark.slow
def test_command_line_makes_and_solves_them(tmp_path):
    def run(*arguments):
        return command_line.run(*arguments, cwd=tmp_path)

    import trimesh

    trimesh.creation.icosphere(subdivisions=2, radius=40.0).export(tmp_path / "ball.stl")
    result = run("mesh", "ball.stl", "ball.vtu", "--unit", "mm", "--max-size", "12mm", "--quadratic")
    assert result.returncode == 0, result.stderr
    assert "10-node tetrahedra" in result.stdout
    mesh = palpate.TetMesh.read(tmp_path / "ball.vtu")
    assert mesh.is_quadratic
    solve = ("--fix", "z < -2cm", "-o", "ball.palpate", "--element", "quadratic")
    solved = run("precompute", "ball.vtu", *solve)
    assert solved.returncode == 0, solved.stderr
    assert f"of {len(mesh.surface_nodes)} surface nodes" in solved.stdout
    refused = run("mesh", "ball.stl", "ball.node", "--unit", "mm", "--max-size", "12mm", "--quadratic")
    assert refused.returncode == 2
    assert "cannot be written to .node files" in refused.stderr


@pytest.mark.slow
def test_a_surface_becomes_ten_node_tetrahedra_unless_told_otherwise(tmp_path):
    import trimesh

    trimesh.creation.icosphere(subdivisions=3, radius=0.04).export(tmp_path / "ball.stl")
    counts = {}
    for element in ("", 'element = "linear"', 'element = "quadratic"'):
        text = f'[body]\nmesh = "ball.stl"\n{element}\n[supports]\nfixed = "z < -0.02"\n'
        (tmp_path / "ball.toml").write_text(text)
        mesh = palpate.Scene.read(tmp_path / "ball.toml").build().bodies[0].body.mesh
        counts[element] = (mesh.tets.shape[1], len(mesh.nodes))
    assert [nodes for nodes, _ in counts.values()] == [10, 4, 10]
    assert counts[""] == counts['element = "quadratic"']
    # At twice the size there are about as many nodes.
    assert 0.5 < counts[""][1] / counts['element = "linear"'][1] < 1.5


@pytest.mark.slow
def test_command_line_takes_the_same_elements(tmp_path):
    import trimesh

    trimesh.creation.icosphere(subdivisions=3, radius=0.04).export(tmp_path / "ball.stl")
    bent(box_mesh(cells=(3, 2, 2)).to_quadratic()).write(tmp_path / "bent.vtu")

    def run(file, *arguments):
        fixed = ("--fix", "z < min + 5mm", "-o", "out.palpate")
        return command_line.run("precompute", file, *fixed, *arguments, cwd=tmp_path)

    for arguments, element in (((), "quadratic"), (("--element", "linear"), "linear")):
        assert run("ball.stl", *arguments).returncode == 0
        assert palpate.GreensFunction.load(tmp_path / "out.palpate").description["element"] == element
    refused = run("bent.vtu", "--element", "linear")
    assert refused.returncode == 2
    assert "bent.vtu holds 10-node tetrahedra: leave out --element" in refused.stderr
