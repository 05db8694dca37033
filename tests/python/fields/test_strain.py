"""Surface strain against motions whose Green strain is known."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from palpate.fields import SurfaceStrain


@pytest.fixture
def surface():
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.05)
    return np.asarray(ball.vertices), SurfaceStrain(np.asarray(ball.vertices), np.asarray(ball.faces))


def test_rigid_motion_strains_nothing(surface):
    points, strain = surface
    turn = trimesh.transformations.rotation_matrix(0.8, (1, 2, 3))[:3, :3]
    assert strain.largest(points @ turn.T + 0.3 - points) < 1e-12


@pytest.mark.parametrize("stretch", [0.95, 1.01, 1.2])
def test_uniform_stretch(surface, stretch):
    points, strain = surface
    assert strain.largest((stretch - 1) * points) == pytest.approx(abs(stretch**2 - 1) / 2, rel=1e-9)


def test_small_shear_is_half_its_angle():
    """A plane sheared by gamma has the principal strains +-gamma/2 (to first order)."""
    grid = np.array([[x, y, 0.0] for x in range(4) for y in range(4)])
    triangles = np.array(
        [[4 * i + j, 4 * i + j + 4, 4 * i + j + 1] for i in range(3) for j in range(3)]
        + [[4 * i + j + 4, 4 * i + j + 5, 4 * i + j + 1] for i in range(3) for j in range(3)]
    )
    gamma = 1e-4
    moved = np.column_stack([gamma * grid[:, 1], np.zeros((16, 2))])
    assert SurfaceStrain(grid, triangles).largest(moved) == pytest.approx(gamma / 2, rel=1e-3)
