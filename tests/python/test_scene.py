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
