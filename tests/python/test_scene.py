"""Scene files: mistakes are named with their line."""

from __future__ import annotations

import pytest

import palpate

GOOD = """\
[body]
mesh = "block.vtu"
unit = "mm"

[material]
youngs_modulus = "10kPa"
poissons_ratio = 0.45

[supports]
fixed = "z < 1mm"

[tool]
radius = "5mm"
"""


def test_quantities_are_si(tmp_path):
    (tmp_path / "a.toml").write_text(GOOD)
    scene = palpate.Scene.read(tmp_path / "a.toml")
    assert scene.material.youngs_modulus == 10e3
    assert scene.tool.radius == pytest.approx(5e-3)
    assert scene.device.max_force > 0


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("youngs_modulus", "young_modulus", r"a\.toml:6: unknown key 'material.young_modulus'; did you mean 'youngs_"),
        ("[tool]", "[tol]", r"a\.toml:12: unknown key 'tol'; did you mean 'tool'"),
        ('"10kPa"', '"10 kilo"', r"a\.toml:6: material.youngs_modulus: unknown unit 'kilo'"),
        ("0.45", "0.5", r"a\.toml:7: material.poissons_ratio: .*less than 0.5"),
        ('"5mm"', '"-5mm"', r"a\.toml:13: tool.radius: .*greater than 0"),
        ('fixed = "z < 1mm"', "", r"a\.toml:9: the key 'supports.fixed' is missing"),
        ('unit = "mm"', "unit = ", r"a\.toml: .*line 3"),
    ],
)
def test_mistakes_are_named_with_their_line(tmp_path, old, new, message):
    (tmp_path / "a.toml").write_text(GOOD.replace(old, new))
    with pytest.raises(palpate.SceneError, match=message):
        palpate.Scene.read(tmp_path / "a.toml")


def test_missing_scene_and_missing_mesh(tmp_path):
    with pytest.raises(palpate.SceneError, match="no such file"):
        palpate.Scene.read(tmp_path / "none.toml")
    (tmp_path / "a.toml").write_text(GOOD)
    with pytest.raises(palpate.MeshError, match=r"block\.vtu: no such file"):
        palpate.Scene.read(tmp_path / "a.toml").build()


def test_models_stores_and_views(tmp_path):
    text = '[body]\nmodel = "kidney"\npaper = true\n[view]\nposition = [0.0, -0.3, 0.1]\ntarget = [0, 0, 0.05]\n'
    (tmp_path / "a.toml").write_text(text)
    scene = palpate.Scene.read(tmp_path / "a.toml")
    assert scene.name == "kidney"
    assert scene.view.position == (0, -0.3, 0.1)
    green = scene.build(progress=False).green
    green.save(tmp_path / "k.palpate")
    (tmp_path / "b.toml").write_text('[body]\nstore = "k.palpate"\n[tool]\nradius = "3mm"\n')
    built = palpate.Scene.read(tmp_path / "b.toml").build()
    assert built.body is None
    assert built.green.key == green.key


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('[body]\nmodel = "kidny"', r"a\.toml:1: body: unknown model 'kidny'; there are doll, kidney"),
        ('[body]\nmodel = "doll"\nmesh = "a.vtu"', r"a\.toml:1: body: give exactly one of mesh, model and store"),
        ("[body]\nunit = 'mm'", r"a\.toml:1: body: give exactly one of"),
        ('[body]\nstore = "a"\n[supports]\nfixed = "z < 0"', "carries its own material and supports"),
        (
            '[body]\nmodel = "doll"\n[view]\ntarget = [0, 0]',
            r"a\.toml:4: view.target: a value is missing after the first 2",
        ),
        ('[body]\nmodel = "doll"\n[view]\nfrom = [0, 0, 1]', r"a\.toml:4: unknown key 'view.from'; known are position"),
        ("", r"a\.toml: the key 'body' is missing"),
    ],
)
def test_mistakes_in_models_stores_and_views(tmp_path, text, message):
    (tmp_path / "a.toml").write_text(text)
    with pytest.raises(palpate.SceneError, match=message):
        palpate.Scene.read(tmp_path / "a.toml")


def test_predicate_that_fixes_nothing_says_where_the_body_is(tmp_path):
    (tmp_path / "a.toml").write_text('[body]\nmodel = "beam"\npaper = true\n[supports]\nfixed = "x > 1km"\n')
    with pytest.raises(palpate.Error, match="km"):
        palpate.Scene.read(tmp_path / "a.toml").build()
    (tmp_path / "a.toml").write_text('[body]\nmodel = "beam"\npaper = true\n[supports]\nfixed = "x > 1m"\n')
    with pytest.raises(palpate.SceneError, match=r"supports.fixed = 'x > 1m': the body reaches from .* to .* m"):
        palpate.Scene.read(tmp_path / "a.toml").build()
