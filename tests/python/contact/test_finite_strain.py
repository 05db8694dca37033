"""Spheres on hyperelastic blocks beside full Newton solutions (`benches/strain`), and materials that are refused."""

from __future__ import annotations

import functools

import numpy as np
import pytest

import palpate
from palpate.body import surface_strain_terms
from palpate.errors import SceneError
from palpate.scene import Scene
from palpate.validation.verify.benchmark import green_of
from palpate.validation.verify.contact.loop import pressed, sphere
from palpate.validation.verify.contact.reference import Block, finer_in_the_middle, top_nodes

RADIUS = 0.01
DEPTHS = np.array([1.0, 2.0, 5.0, 10.0]) * 1e-3
# Forces, N, on a sphere of 10 mm in the middle of a cylinder of 100 mm radius and 50 mm height on a table, E = 10 kPa:
# 9-node axisymmetric elements, full Newton's method, by Poisson's ratio.
FORCES = {
    0.45: np.array([0.05548, 0.15871, 0.62977, 1.70484]),
    0.3: np.array([0.04996, 0.14438, 0.58629, 1.63822]),
}


REACH = 0.02


def block_of(material: palpate.Material) -> palpate.Body:
    return finer_in_the_middle(Block((0.2, 0.2, 0.05), material), 0.005, REACH, quadratic=True)


@functools.cache
def green_function(ratio: float) -> palpate.GreensFunction:
    """That of all materials of 10 kPa with this Poisson's ratio: laws differ only beyond small strain."""
    body = block_of(palpate.Material(10e3, ratio))
    return green_of(body, touch=top_nodes(body, REACH))


def forces_on(material: palpate.Material) -> np.ndarray:
    assert material.youngs_modulus == pytest.approx(10e3, rel=1e-12)
    green = green_function(material.poissons_ratio)
    return pressed(block_of(material), sphere(RADIUS), RADIUS, DEPTHS, REACH, green)


ALLOWED = 2.5e-2


@pytest.mark.parametrize("ratio", [0.45, pytest.param(0.3, marks=pytest.mark.slow)])
def test_a_neo_hookean_block_has_the_force_of_a_full_solution(ratio):
    found = forces_on(palpate.Material(10e3, ratio, law="neo-hookean"))
    np.testing.assert_allclose(found, FORCES[ratio], rtol=ALLOWED)


@pytest.mark.slow
def test_the_linear_law_fails_the_same_bound():
    errors = np.abs(forces_on(palpate.Material(10e3, 0.45)) / FORCES[0.45] - 1.0)
    assert errors[2] > 1.4 * ALLOWED
    assert errors[3] > 2.5 * ALLOWED


@pytest.mark.slow
def test_a_yeoh_material_stiffens_and_two_ways_of_writing_one_agree():
    # E = 4 (1 + nu) c10.
    c10 = 10e3 / (4 * 1.45)
    yeoh = palpate.Material(law="yeoh", c10=c10, c20=c10, poissons_ratio=0.45)
    plain = palpate.Material(law="yeoh", c10=c10, poissons_ratio=0.45)
    first, second = (forces_on(material) for material in (plain, yeoh))
    assert (second > first).all() and second[3] > 1.1 * first[3]
    rivlin = palpate.Material(law="mooney-rivlin", c10=c10, c01=0.0, poissons_ratio=0.45)
    np.testing.assert_allclose(forces_on(rivlin), first, rtol=1e-12)


def test_moduli_follow_from_constants():
    material = palpate.Material(law="mooney-rivlin", c10="1.2kPa", c01="0.4kPa", poissons_ratio=0.45)
    # E = 2 mu (1 + nu), mu = 2 (c10 + c01).
    assert material.youngs_modulus == pytest.approx(4 * 1.45 * 1600)
    assert not palpate.Material(10e3, 0.45).strain_terms.any()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"law": "hooke"}, "law must be one of"),
        ({"law": "yeoh"}, "'c10' is missing"),
        ({"law": "yeoh", "c10": 1e3, "c01": 1.0}, "'c01' does not belong"),
        ({"law": "mooney-rivlin", "c10": 1e3, "poissons_ratio": 0.2}, "at least 0.3"),
        ({"law": "yeoh", "c10": 1e3, "youngs_modulus": 1e3}, "leave one out"),
        ({"law": "yeoh", "c10": -1e3}, "c10 must be positive"),
        ({"poissons_ratio": 0.4}, "needs a Young's modulus"),
    ],
)
def test_wrong_materials_are_refused(given, message):
    with pytest.raises(palpate.BodyError, match=message):
        palpate.Material(**given)


def test_regions_have_laws_of_their_own():
    region = {"shape": "half-space", "point": (0, 0, 0), "normal": (0, 0, 1), "law": "yeoh", "c10": "2kPa"}
    scene = Scene(
        body={"model": "liver"},
        material={"law": "neo-hookean", "youngs_modulus": "6kPa", "poissons_ratio": 0.4},
        region=[region],
    )
    own = scene.region[0].material(scene.material)
    assert (own.law, own.poissons_ratio) == ("yeoh", 0.4)
    assert own.youngs_modulus == pytest.approx(4 * 1.4 * 2e3)
    assert scene.material.material().law == "neo-hookean"


def test_a_mistake_in_a_scene_names_its_key(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text('[body]\nmodel = "liver"\n[material]\nlaw = "mooney-rivlin"\n')
    with pytest.raises(SceneError, match="'c10' is missing"):
        Scene.read(path)


def test_terms_at_the_surface_are_those_of_the_elements_there():
    material = palpate.Material(10e3, 0.3, law="neo-hookean")
    body = finer_in_the_middle(Block(material=material), 0.02, 0.02, quadratic=False)
    terms = surface_strain_terms(body)
    assert terms.shape == (len(body.mesh.surface_nodes), 3)
    np.testing.assert_allclose(terms, np.broadcast_to(material.strain_terms, terms.shape))
