"""Palpate.cs under Mono: the forces of C to the bit, mirrored axes, scenes freed once; the Unity component compiles."""

from __future__ import annotations

import shutil

import numpy as np
import pytest
from test_capi import ROOT, compiled, packed, prefix, run, scene  # noqa: F401  fixtures

import palpate

missing = [tool for tool in ("mcs", "mono", "gcc", "cargo") if shutil.which(tool) is None]
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(bool(missing), reason=f"{', '.join(missing)}: not installed"),
]


def built(prefix, folder, name, *sources, kind="exe"):  # noqa: F811
    program = folder / name
    run("mcs", "-warnaserror", f"-target:{kind}", f"-out:{program}", *sources, prefix / "include/Palpate.cs")
    return program


def test_the_example_has_the_forces_of_c_and_python_to_the_bit(prefix, block, block_green, tmp_path):  # noqa: F811
    tables = palpate.Scene(body={"store": "b"}, tool={"radius": 0.006}, view={"strain_limit": 0}, device={"ramp": 0.05})
    whole = palpate.scene.BuiltScene.of(tables, block, block_green)
    palpate.pack(whole, tmp_path / "block.pack")
    program = built(prefix, tmp_path, "press.exe", ROOT / "examples/csharp/Press.cs")
    result = run("mono", program, tmp_path / "block.pack", 400, LD_LIBRARY_PATH=f"{prefix}/lib")
    rows = np.loadtxt(result.splitlines()[1:], delimiter=",")
    assert len(rows) == 400 and rows[:, 5].max() > 0.05
    positions = np.ascontiguousarray(rows[:, None, :3])
    assert np.array_equal(palpate.Simulation(whole).run(positions)[:, 0], rows[:, 3:])
    in_c = compiled(prefix, ROOT / "tests/c/same_bits.c")
    (tmp_path / "positions").write_bytes(positions.tobytes())
    run(in_c, tmp_path / "block.pack", tmp_path / "positions", 1, tmp_path / "forces")
    for forces in np.fromfile(tmp_path / "forces").reshape(2, 400, 3):
        assert np.array_equal(forces, rows[:, 3:])


def test_axes_are_mirrored_and_scenes_freed_once(prefix, packed, tmp_path):  # noqa: F811
    program = built(prefix, tmp_path, "checks.exe", ROOT / "tests/csharp/Checks.cs")
    assert run("mono", program, packed, LD_LIBRARY_PATH=f"{prefix}/lib").strip() == "ok"


def test_the_component_for_unity_compiles(prefix, tmp_path):  # noqa: F811
    sources = ROOT / "examples/unity/PalpateBody.cs", ROOT / "tests/csharp/UnityEngine.cs"
    assert built(prefix, tmp_path, "unity.dll", *sources, kind="library").exists()
