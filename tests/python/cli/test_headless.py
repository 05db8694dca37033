"""What a scripted press says held the tool: the limit of force, that of strain, or nothing."""

from __future__ import annotations

import re

import pytest
from command_line import run
from conftest import box_mesh

import palpate


@pytest.mark.parametrize(
    ("modulus", "max_force", "strain_limit", "by_force", "by_strain"),
    [
        # A block of 50 mm pressed by 2.4 mm: the forces go with the modulus, the strain does not.
        ("10kPa", "8N", 0.3, False, False),
        ("10MPa", "8N", 0.3, True, False),
        ("10kPa", "8N", 0.002, False, True),
    ],
)
def test_the_limit_that_held_is_the_one_named(tmp_path, modulus, max_force, strain_limit, by_force, by_strain):
    box_mesh().write(tmp_path / "box.vtu")
    (tmp_path / "press.toml").write_text(
        f'[body]\nmesh = "box.vtu"\n[supports]\nfixed = "z < min + 1mm"\n[material]\nlaw = "linear"\n'
        f'youngs_modulus = "{modulus}"\n'
        f'[device]\nmax_force = "{max_force}"\n[view]\nstrain_limit = {strain_limit}\n'
    )
    text = run("run", "press.toml", "--headless", "1", cwd=tmp_path).stdout
    force = float(re.search(r"largest force ([\d.]+) N", text)[1])
    strain = float(re.search(r"largest strain ([\d.]+) %", text)[1])
    assert ("max_force" in text) == by_force
    assert ("strain_limit" in text) == by_strain
    assert (force == pytest.approx(palpate.units.force(max_force))) == by_force
    assert (strain == pytest.approx(100 * strain_limit, rel=0.1)) == by_strain
