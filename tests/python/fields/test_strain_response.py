"""The strain response of contacts against all places of the body, sampled and evaluated by NumPy."""

from __future__ import annotations

import numpy as np
import pytest

import palpate
from palpate import _native
from palpate.fields import ElementStrain, StrainMeasure, SurfaceStrain
from palpate.fields.stress import StressRecovery

# What the limit keeps below itself.
MARGIN = 1e-3
LIMIT = 0.1
RADIUS = 0.008
# Part of the share by which the places that are watched may mislead.
ACCURACY = 0.01


class Measured:
    """A body with both measures of its strain, and patches far from its supports."""

    def __init__(self, body: palpate.Body, surface: bool):
        self.green = palpate.precompute(body, precision="f64", progress=False)
        self.core = self.green._core
        self.positions = self.core.surface_positions.reshape(-1, 3)
        if surface:
            # Flat faces: those of six nodes are averaged around nodes when drawn.
            self.numeric: StrainMeasure = SurfaceStrain(self.positions, self.green.surface_triangles)
            self.measure = _native.StrainMeasure.of_surface(self.core)
        else:
            recovery = StressRecovery(body)
            self.numeric = ElementStrain(recovery)
            operator = recovery.strain_operator
            parts = operator.indptr.astype(np.int64), operator.indices.astype(np.uint32), operator.data
            self.measure = _native.StrainMeasure.of_elements(*parts, recovery.interior.core)
        self.base = self.numeric.sample(self.green.free_displacements)
        self.counted = self.numeric.magnitudes(self.base) < (1 - MARGIN) * LIMIT

    def patches(self, count: int, seed: int) -> list[tuple[np.ndarray, np.ndarray]]:
        """Patches that begin anywhere but on a support."""
        held = np.isin(self.core.surface_nodes, self.core.fixed_dofs // 3)
        nodes = np.random.default_rng(seed).choice(np.flatnonzero(~held), count, replace=False)
        return [_native.contact_patch(self.core, tuple(self.positions[node]), RADIUS) for node in nodes]

    def pose(self, nodes: np.ndarray, weights: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Displacements (s, 3) under a force (N) on a patch, m; what acts on supports does nothing."""
        held = np.isin(self.core.surface_nodes[nodes], self.core.fixed_dofs // 3)
        loaded = zip(self.core.surface_nodes[nodes[~held]].tolist(), weights[~held], strict=True)
        return self.green.solve(forces={node: weight * force for node, weight in loaded}).displacements

    def slopes(self, patches: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
        """Change of the sample per newton on each patch along x, y, z, (contacts, 3, ...), by direct solves."""
        slopes = [self.numeric.sample(self.pose(*patch, axis)) - self.base for patch in patches for axis in np.eye(3)]
        return np.array(slopes).reshape(len(patches), 3, *self.base.shape)

    def largest(self, slopes: np.ndarray, forces: np.ndarray) -> float:
        """Largest strain of the places that count under forces (contacts, 3), N."""
        magnitudes = self.numeric.magnitudes(self.base + np.tensordot(forces, slopes, axes=2))
        return float(magnitudes.max(initial=0.0, where=self.counted))

    def share(self, slopes: np.ndarray, forces: np.ndarray) -> float:
        """First share of the forces at which the limit is met, by bisection."""
        low, high = 0.0, 1.0
        while high - low > 1e-4 * high:
            middle = (low + high) / 2
            low, high = (low, middle) if self.largest(slopes, middle * forces) > LIMIT else (middle, high)
        return low


@pytest.fixture(scope="module", params=["elements", "loaded", "surface", "loaded surface"])
def measured(request):
    name, loads = "kidney", None
    if "loaded" in request.param:
        loads = palpate.Loads(gravity=(0, 0, -2.0))
    mesh = palpate.models.load(name, paper=True)
    material = palpate.Material(10e3, 0.45, 1000.0)
    body = palpate.Body(mesh, material=material, fixed=palpate.models.fixed(name, mesh), loads=loads)
    return Measured(body, "surface" in request.param)


def test_the_strain_of_a_pose_is_that_of_the_numeric(measured):
    displacements = 0.004 * np.random.default_rng(5).normal(size=measured.positions.shape)
    expected = measured.numeric.largest(displacements)
    assert measured.measure.largest(displacements.ravel()) == pytest.approx(expected, rel=1e-9)


@pytest.mark.quick(2)
@pytest.mark.parametrize("contacts", [1, 2])
def test_the_share_is_that_of_all_places(measured, contacts):
    random = np.random.default_rng(7)
    errors, wrong = [], []
    for seed in range(6):
        patches = measured.patches(contacts, seed)
        response = measured.measure.prepare(measured.core, patches, LIMIT)
        assert 1 <= response.places <= 32
        slopes = measured.slopes(patches)
        for _ in range(12):
            forces = random.normal(size=(contacts, 3))
            forces *= 10 ** random.uniform(0, 1.5)
            if measured.largest(slopes, forces) < 1.5 * LIMIT:
                assert response.share(forces.tolist(), LIMIT) > 0.5
                continue
            expected = measured.share(slopes, forces)
            errors.append(response.share(forces.tolist(), LIMIT) / expected - 1)
            wrong.append(response.share((1.05 * forces).tolist(), LIMIT) / expected - 1)
    # Fewer places see less strain: what passes the limit is bounded, what stays below it is the margin.
    assert len(errors) > 20
    assert np.abs(errors).max() <= ACCURACY
    # Slopes that are wrong by 5 % would be noticed.
    assert np.abs(wrong).max() > ACCURACY and np.median(np.abs(wrong)) > ACCURACY


def test_strain_at_the_share_is_the_limit(measured):
    (patch,) = measured.patches(1, 3)
    response = measured.measure.prepare(measured.core, [patch], LIMIT)
    forces = np.array([[1.0, -2.0, 0.5]])
    for scale in (10.0, 100.0):
        share = response.share((scale * forces).tolist(), LIMIT)
        assert 0 < share < 1
        strain = response.largest((share * scale * forces).tolist())
        assert (1 - 2.01 * MARGIN) * LIMIT <= strain <= LIMIT
    assert response.share((0 * forces).tolist(), LIMIT) == 1.0
    assert response.share([[float("nan"), 0.0, 0.0]], LIMIT) == 0.0


def test_a_patch_that_moves_provisionally_far_is_within_the_limit(measured):
    corners = measured.positions[measured.green.surface_triangles]
    floor = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean()
    at_rest = measured.numeric.magnitudes(measured.base)[measured.counted].max()
    for seed in range(6):
        ((nodes, weights),) = measured.patches(1, seed)
        held = np.isin(measured.core.surface_nodes[nodes], measured.core.fixed_dofs // 3)
        moving = np.where(held, 0.0, weights)
        far = _native.provisional_displacement(moving, measured.positions[nodes].ravel(), floor, LIMIT)
        assert far > 0
        slopes = measured.slopes([(nodes, weights)])
        free = measured.green.free_displacements
        compliance = [weights @ (measured.pose(nodes, weights, axis) - free)[nodes] for axis in np.eye(3)]
        for direction in np.eye(3):
            forces = np.linalg.solve(np.transpose(compliance), far * direction)[None]
            assert measured.largest(slopes, forces) - at_rest < LIMIT


def test_what_does_not_fit_is_refused(measured):
    (patch,) = measured.patches(1, 0)
    with pytest.raises(palpate.Error, match="1 to 4 contacts, got 5"):
        measured.measure.prepare(measured.core, 5 * [patch], LIMIT)
    with pytest.raises(palpate.Error, match="limit of strain must be positive"):
        measured.measure.prepare(measured.core, [patch], 0.0)
    with pytest.raises(palpate.Error, match="not touchable"):
        measured.measure.prepare(measured.core, [(np.array([10**6], np.uint32), np.ones(1))], LIMIT)
    response = measured.measure.prepare(measured.core, [patch], LIMIT)
    with pytest.raises(palpate.Error, match="a force for each of 1 contacts"):
        response.share([[0.0, 0.0, 0.0]] * 2, LIMIT)


def test_an_operator_that_is_no_strain_is_refused(block):
    interior = StressRecovery(block).interior.core
    start, columns = np.arange(7, dtype=np.int64), np.array([0, 1, 2, 0, 1, 2], np.uint32)
    with pytest.raises(palpate.Error, match="symmetric part of a gradient in row 3"):
        _native.StrainMeasure.of_elements(start, columns, np.ones(6), interior)
