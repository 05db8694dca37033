"""Names, files, supports and published numbers of the models."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import resources
from typing import Literal

import numpy as np

from palpate.errors import MeshError
from palpate.mesh import TetMesh

NAMES = ("doll", "kidney", "liver", "beam")


@dataclass(frozen=True)
class PaperModel:
    """What the paper (Jun, Choi and Cho) prints about a model; None where it prints nothing.

    Attributes
    ----------
    nodes, tets, surface_nodes, surface_triangles
        Counts of the mesh.
    precompute_minutes
        Table 1: all of Green's functions.
    simulation_ms
        Table 1: force and deformation of one contact.
    step_seconds
        Table 2: one Newmark step.
    dofs
        Table 2: degrees of freedom.
    note
        Where the counts contradict themselves, and what the model here keeps.

    """

    nodes: int
    tets: int
    surface_nodes: int | None = None
    surface_triangles: int | None = None
    precompute_minutes: float | None = None
    simulation_ms: float | None = None
    step_seconds: float | None = None
    dofs: int | None = None
    note: str = ""


# Tables 1 and 2 of the paper. "liver_dynamic" is the coarser liver of table 2.
PAPER = {
    "doll": PaperModel(894, 2803, 714, 1424, precompute_minutes=5.0, simulation_ms=0.5),
    "kidney": PaperModel(
        *(572, 1749, 454, 900),
        precompute_minutes=1.1,
        simulation_ms=0.5,
        note="a closed surface of 454 nodes without holes has 904 triangles, not 900",
    ),
    "liver": PaperModel(
        *(1931, 5430, 845, 1686),
        precompute_minutes=27.8,
        simulation_ms=0.6,
        note="5430 tetrahedra with 845 surface nodes have about 1400 nodes, not 1931; tetrahedra and surface are kept",
    ),
    "beam": PaperModel(281, 873, dofs=843, step_seconds=0.02),
    "liver_dynamic": PaperModel(784, 2671, dofs=2352, step_seconds=0.17, note="the surface's counts are not given"),
}


def load(name: str, paper: bool = False) -> TetMesh:
    """Read a shipped model.

    Parameters
    ----------
    name
        One of :data:`NAMES`; with ``paper`` also ``"liver_dynamic"``, the coarser liver of the paper's table 2.
    paper
        With the paper's numbers of nodes and elements (within 5 %), 4 nodes each, instead of 10-node elements.

    Returns
    -------
    TetMesh
        Nodes in metres, resting on z = 0.

    Raises
    ------
    MeshError
        An unknown name.

    """
    known = tuple(PAPER) if paper else NAMES
    if name not in known:
        raise MeshError(f"no model is called {name!r}; there are {', '.join(known)}")
    file = resources.files("palpate.models") / "data" / f"{name}{'-paper' if paper else ''}.npz"
    with file.open("rb") as stream, np.load(stream, allow_pickle=False) as data:
        return TetMesh(data["nodes"], data["tets"])


def doll(paper: bool = False) -> TetMesh:
    """Return a sitting plush bear, 0.25 m tall."""
    return load("doll", paper)


def kidney(paper: bool = False) -> TetMesh:
    """Return a kidney with a stub of its ureter, 0.11 m long, upright."""
    return load("kidney", paper)


def liver(paper: bool | Literal["dynamic"] = False) -> TetMesh:
    """Return a liver, 0.2 m wide, upright; ``paper="dynamic"`` is the coarser one of the paper's table 2."""
    return load("liver_dynamic", paper=True) if paper == "dynamic" else load("liver", bool(paper))


def beam(paper: bool = False) -> TetMesh:
    """Return a beam, 100 x 20 x 20 mm, along x from x = 0."""
    return load("beam", paper)


def fixed(name: str, mesh: TetMesh) -> np.ndarray:
    """Return the nodes where a model is fixed, as a mask for :class:`palpate.Body`.

    The doll stands on its seat and the under-sides of its legs. The kidney lies on its back. The liver hangs on the
    bare area at its back and top, where its ligaments are. The beam is clamped at x = 0.

    Parameters
    ----------
    name
        The model's name, one of :data:`NAMES` or ``"liver_dynamic"``.
    mesh
        Any mesh of that model, in its place.

    Returns
    -------
    numpy.ndarray
        (n,) bool.

    Raises
    ------
    MeshError
        An unknown name.

    """
    if name not in PAPER:
        raise MeshError(f"no model is called {name!r}; there are {', '.join(NAMES)}")
    x, y, z = mesh.nodes.T
    if name == "beam":
        return x < 1e-6
    on_surface = np.zeros(len(mesh.nodes), dtype=bool)
    on_surface[mesh.surface_nodes] = True
    if name == "doll":
        return on_surface & (z < 0.006)
    if name == "kidney":
        return on_surface & (y > 0.0145)
    return on_surface & (y > 0.035)
