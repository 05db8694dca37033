"""The same bodies solved by CalculiX, other people's program: displacements and reactions agree to its last digits."""

from __future__ import annotations

import re
import shutil
import subprocess

import numpy as np
import pytest
from conftest import box_mesh, relative

import palpate
from palpate.fields import Interior

pytestmark = pytest.mark.skipif(
    shutil.which("ccx") is None, reason="CalculiX is not installed (Debian: apt install calculix-ccx)"
)

# CalculiX prints seven digits.
AGREEMENT = 1e-5
SOFT, HARD = palpate.Material(9e3, 0.45, 1050.0), palpate.Material(60e3, 0.3, 1900.0)
GRAVITY = (3.0, -2.0, -9.81)
PRESSURE = 400.0
SIZE = (0.08, 0.05, 0.05)

# Face numbers of C3D4 and C3D10 by the corner opposite: S1 is 1-2-3, S2 1-4-2, S3 2-4-3, S4 3-4-1 (user's manual).
FACE_OPPOSITE = (3, 4, 2, 1)


def two_materials(quadratic: bool) -> palpate.TetMesh:
    mesh = box_mesh(cells=(5, 3, 3), size=SIZE, jitter=0.2, seed=5)
    mesh = mesh.with_regions({"hard": palpate.shapes.Sphere((0.03, 0.02, 0.03), 0.018)})
    return mesh.to_quadratic() if quadratic else mesh


def on_top(p):
    return p[:, 2] > SIZE[2] - 1e-9


def numbered(values) -> str:
    """Comma-separated, sixteen to a line as the format demands."""
    values = [str(v) for v in values]
    return ",\n".join(", ".join(values[k : k + 16]) for k in range(0, len(values), 16))


def loaded_faces(mesh: palpate.TetMesh) -> list[tuple[int, int]]:
    """Element and face number, both from 1, of the faces on top."""
    top = on_top(mesh.nodes)
    corners = mesh.tets[:, :4]
    return [
        (int(element) + 1, FACE_OPPOSITE[corner])
        for corner in range(4)
        for element in np.flatnonzero(top[np.delete(corners, corner, axis=1)].all(axis=1))
    ]


def input_deck(mesh, forces, boundary) -> str:
    """Abaqus keywords: `forces` by node, `boundary` of (node, axis, value)."""
    lines = ["*NODE, NSET=ALL"]
    lines += [f"{i + 1}, {x:.16g}, {y:.16g}, {z:.16g}" for i, (x, y, z) in enumerate(mesh.nodes)]
    for region, (name, material) in enumerate((("SOFT", SOFT), ("HARD", HARD))):
        kind = f"C3D{mesh.tets.shape[1]}"
        lines.append(f"*ELEMENT, TYPE={kind}, ELSET={name}")
        for element in np.flatnonzero(mesh.regions == region):
            lines.append(numbered([element + 1, *(mesh.tets[element] + 1)]))
        lines += [
            f"*MATERIAL, NAME={name}",
            "*ELASTIC",
            f"{material.youngs_modulus:.16g}, {material.poissons_ratio:.16g}",
            "*DENSITY",
            f"{material.density:.16g}",
            f"*SOLID SECTION, ELSET={name}, MATERIAL={name}",
        ]
    lines += ["*BOUNDARY", *(f"{node + 1}, {axis + 1}, {axis + 1}, {u:.16g}" for node, axis, u in boundary)]
    size = np.linalg.norm(GRAVITY)
    direction = ", ".join(f"{g / size:.16g}" for g in GRAVITY)
    lines += ["*STEP", "*STATIC", "*DLOAD"]
    lines += [f"{name}, GRAV, {size:.16g}, {direction}" for name in ("SOFT", "HARD")]
    lines += [f"{element}, P{face}, {PRESSURE:.16g}" for element, face in loaded_faces(mesh)]
    lines.append("*CLOAD")
    lines += [f"{n + 1}, {axis + 1}, {f:.16g}" for n, force in forces.items() for axis, f in enumerate(force)]
    lines += ["*NODE PRINT, NSET=ALL", "U, RF", "*END STEP", ""]
    return "\n".join(lines)


def solved_by_calculix(deck: str, nodes: int, folder) -> tuple[np.ndarray, np.ndarray]:
    """Displacements and `K u` of all nodes."""
    (folder / "body.inp").write_text(deck)
    result = subprocess.run(["ccx", "body"], cwd=folder, capture_output=True, text=True, timeout=280)
    assert "*ERROR" not in result.stdout, result.stdout
    blocks = {"displacements": np.full((nodes, 3), np.nan), "forces": np.full((nodes, 3), np.nan)}
    table = None
    for line in (folder / "body.dat").read_text().splitlines():
        title = re.match(r"\s*(displacements|forces) ", line)
        table = blocks[title[1]] if title else table
        if table is not None and re.match(r"\s+\d+\s", line):
            node, *values = line.split()
            table[int(node) - 1] = [float(v) for v in values]
    assert np.isfinite(blocks["displacements"]).all()
    assert np.isfinite(blocks["forces"]).all()
    return blocks["displacements"], blocks["forces"]


@pytest.mark.parametrize("quadratic", [False, True], ids=["C3D4", "C3D10"])
def test_two_materials_under_all_loads_and_moved_supports(quadratic, tmp_path):
    mesh = two_materials(quadratic)
    assert set(mesh.regions) == {0, 1}
    inner = int(np.linalg.norm(mesh.nodes - [0.05, 0.025, 0.025], axis=1).argmin())
    corner = int(np.linalg.norm(mesh.nodes - SIZE, axis=1).argmin())
    forces = {inner: (0.2, 0.1, -0.3), corner: (-0.1, 0.05, 0.1)}
    loads = palpate.Loads(gravity=GRAVITY, pressure=[(on_top, PRESSURE)], forces=forces)
    body = palpate.Body(mesh, material={0: SOFT, 1: HARD}, fixed=lambda p: p[:, 0] < 1e-9, loads=loads)

    # Some supports move; a node of the free end is taken along in two of its components.
    moved = [int(n) for n in body.fixed_nodes[::4]]
    motion = {n: (1e-4 * (k % 3), -5e-5 * k, 2e-4) for k, n in enumerate(moved)}
    pulled = int(np.linalg.norm(mesh.nodes - [SIZE[0], 0, 0], axis=1).argmin())
    green = palpate.precompute(body, precision="f64", path=tmp_path / "green.palpate")
    answer = green.solve(displacements={**motion, pulled: (1e-3, None, -2e-3)})

    boundary = [(n, axis, motion.get(n, (0, 0, 0))[axis]) for n in map(int, body.fixed_nodes) for axis in range(3)]
    boundary += [(pulled, 0, 1e-3), (pulled, 2, -2e-3)]
    u, f = solved_by_calculix(input_deck(mesh, forces, boundary), len(mesh.nodes), tmp_path)

    ours = Interior(body).extend(answer.displacements)
    assert relative(ours, u) <= AGREEMENT
    assert relative(answer.displacements, u[mesh.surface_nodes]) <= AGREEMENT
    assert relative(answer.reactions, f[body.fixed_nodes]) <= AGREEMENT
    pull = np.searchsorted(mesh.surface_nodes, pulled)
    assert relative(answer.forces[pull], f[pulled]) <= AGREEMENT
    assert np.abs(u).max() > 1e-3
