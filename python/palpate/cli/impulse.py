"""A body struck once and left to swing: the paper's figure 5."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import numpy as np

from palpate import models
from palpate.body import Body, Material, free_end
from palpate.cli.app import print_note
from palpate.dynamics import Newmark, rayleigh_from_ratios
from palpate.errors import SceneError
from palpate.fields import LINEAR_STRAIN_LIMIT, SurfaceStrain
from palpate.progress import status_line
from palpate.scene import MODES, TOOLS, Scene
from palpate.validation.plots import plot_history, write_columns

# Force of the strike, N, along z, and the step at whose end it acts. The force rises and falls linearly over one step
# each, so the impulse is force times step: 0.01 N s.
FORCE, STEP = 10.0, 1e-3
# Hard rubber: the beam swings by millimetres at 30 Hz, slow enough for steps of 1 ms. The paper gives no material. The
# elements around the struck node deform far more than the rest, the more so the finer they are: that is reported.
MATERIAL = Material(youngs_modulus=10e6, poissons_ratio=0.45, density=1000.0)
# Three hundredths of critical damping at 15 Hz and at 300 Hz.
DAMPING = (0.03, 15.0, 0.03, 300.0)
SECONDS = 0.5


def impulse_history(model: str, paper: bool, seconds: float, out: Path) -> None:
    """Strike the free node farthest from the supports, and write how it moves as CSV and PNG.

    Raises SceneError for no model of that name.
    """
    body = _body(model, paper)
    mesh, node = body.mesh, free_end(body)
    with status_line(f"{model}: {seconds:g} s of motion"):
        forces, surface = _strike(body, node, seconds)
    moved = surface[:, np.searchsorted(mesh.surface_nodes, node)]
    out.mkdir(parents=True, exist_ok=True)
    name = f"{model}{'-paper' if paper else ''}-impulse"
    time = STEP * np.arange(len(moved))
    columns = [time, *moved.T, forces[:, 2]]
    write_columns(("time_s", "ux_m", "uy_m", "uz_m", "fz_N"), columns, out / f"{name}.csv")
    title = f"{name}: {FORCE:g} N for {1e3 * STEP:g} ms along z at node {node}"
    plot_history(time, moved, out / f"{name}.png", title)
    print(f"node {node} at {(1e3 * mesh.nodes[node]).round(1).tolist()} mm: {FORCE:g} N along z for {1e3 * STEP:g} ms")
    print(f"largest displacement {1e3 * np.linalg.norm(moved, axis=1).max():.3f} mm within {seconds:g} s")
    print(f"wrote {out / name}.csv and .png")
    strain = _largest_strain(body, surface)
    if strain > LINEAR_STRAIN_LIMIT:
        print_note(f"strains reach {100 * strain:.0f} % where the node is struck, beyond linear elasticity")


def impulse_scene(model: str, paper: bool) -> Scene:
    """Scene of the same body and strike, for the viewer: on the node itself, by average acceleration as in the paper.

    Raises SceneError for no model of that name.
    """
    body = _body(model, paper)
    xi1, f1, xi2, f2 = DAMPING
    return Scene(
        body={"model": model, "paper": paper},
        material=asdict(MATERIAL),
        # Touched, the body answers by the local law. The strike is no contact: its force is given, and only where it
        # acts is to be said. `contact_radius` 0 is the node alone, as in the paper's figure.
        tool={"contact": "local", "radius": TOOLS[model], "contact_radius": 0.0},
        dynamics={
            **MODES[paper],
            "dt": STEP,
            "delta": 0.5,
            "rayleigh": rayleigh_from_ratios(xi1, f1, xi2, f2),
            "strike": {"point": body.mesh.nodes[free_end(body)].tolist(), "impulse": (0, 0, FORCE * STEP)},
        },
    )


def _body(model: str, paper: bool) -> Body:
    if model not in models.NAMES:
        raise SceneError(f"there is no model '{model}'; there are {', '.join(models.NAMES)}")
    mesh = models.load(model, paper=paper)
    return Body(mesh, material=MATERIAL, fixed=models.fixed(model, mesh))


def _strike(body: Body, node: int, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Return forces (t, 3), N, on the node and displacements (t, s, 3), m, of the surface, from rest at t = 0."""
    motion = Newmark(body, STEP, rayleigh=rayleigh_from_ratios(*DAMPING), method="sparse")
    steps = max(1, round(seconds / STEP))
    forces = np.zeros((steps + 1, 3))
    forces[1, 2] = FORCE
    moved = motion.play([node], forces[1:, None], body.mesh.surface_nodes)
    return forces, np.concatenate([np.zeros_like(moved[:1]), moved])


def _largest_strain(body: Body, surface: np.ndarray) -> float:
    """Largest strain of the surface at any step."""
    ranks = np.searchsorted(body.mesh.surface_nodes, body.mesh.surface_triangles)
    strain = SurfaceStrain(body.mesh.nodes[body.mesh.surface_nodes], ranks)
    return max(strain.largest(frame) for frame in surface)
