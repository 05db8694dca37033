"""Parts of a body that can move without deforming: unsupported ones, and those on hinges and balls.

Elements that share a face move as one rigid body where they do not deform, for a face has three nodes that are not in
line. So the motions without strain energy of a mesh are a rigid motion `u(x) = t + w x (x - c) / s` of each of its
parts connected by faces, equal at the nodes that parts share and zero where components are fixed: a small linear system
of six unknowns a part, whose null space is that of the stiffness matrix. A part that meets the others at a node hangs
on a ball, along an edge on a hinge; a mechanism may pass over several parts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from palpate.body.supports import rigid_constraint_rank
from palpate.mesh import TetMesh
from palpate.mesh.elements import face_parts
from palpate.vectors import place_text

# Eigenvalue of the system of a part held by three nodes, one of them off the line of the others by 1e-5 of its size.
SINGULAR = 1e-10
# Up to so many parts the system is solved densely.
DENSE_PARTS = 50
# A part moves if it does so by more than this share of the one that moves most.
MOVES = 1e-3


@dataclass(frozen=True)
class Mechanism:
    """A part that moves without deforming."""

    nodes: np.ndarray
    joints: np.ndarray  # those that it shares with other parts
    freedom: int  # motions of the whole body without deformation
    parts: int  # how many parts take part in them

    def message(self, positions: np.ndarray, whole: int) -> str:
        """Say where it is and what helps; ``positions`` (n, 3) m of the nodes, ``whole`` how many nodes a body has."""
        part = f"the part of {len(self.nodes)} nodes around {place_text(positions[self.nodes].mean(axis=0))}"
        points = positions[self.joints]
        spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
        if len(points) == 1:
            joint = f"node {self.joints[0]} at {place_text(points[0])}, and turns about it"
        elif spread[1] <= np.sqrt(SINGULAR) * spread[0]:
            ends = np.lexsort(points.T)[[0, -1]]
            nodes = " and ".join(f"{self.joints[end]} at {place_text(points[end])}" for end in ends)
            joint = f"the edge between nodes {nodes}, and turns about it"
        else:
            middle = place_text(points.mean(axis=0))
            joint = f"{len(points)} nodes around {middle}, and moves with {self.parts - 1} others"
        return (
            f"{part} meets the other {whole - len(self.nodes) + len(points)} only at {joint} without deforming: "
            "join the parts by faces of elements, or fix nodes of this one too"
        )


def find_mechanism(mesh: TetMesh, fixed: np.ndarray) -> Mechanism | None:
    """Find the smallest part that can move without deforming; ``fixed`` (n, 3) are the fixed components."""
    labels = face_parts(mesh.tets)
    if labels.max() == 0 and rigid_constraint_rank(mesh.nodes, fixed) == 6:
        return None
    pairs = np.unique(np.column_stack([np.repeat(labels, mesh.tets.shape[1]), mesh.tets.ravel()]), axis=0)
    part, node = pairs.T
    motions = _strainless_motions(_Parts(mesh.nodes, part, node), fixed)
    if motions.shape[1] == 0:
        return None
    size = np.sqrt((motions**2).reshape(-1, 6 * motions.shape[1]).sum(axis=1))
    moving = np.flatnonzero(size > MOVES * size.max())
    smallest = moving[np.argmin(np.bincount(part)[moving])]
    members = node[part == smallest]
    shared = np.bincount(node, minlength=len(mesh.nodes))[members] > 1
    return Mechanism(members, members[shared], motions.shape[1], len(moving))


class _Parts:
    """Parts of a mesh by the nodes of each, and their frames: centre and size."""

    def __init__(self, nodes: np.ndarray, part: np.ndarray, node: np.ndarray):
        self.part, self.node, self.count = part, node, int(part.max()) + 1
        self._nodes = nodes
        members = np.bincount(part)
        self._centre = np.stack([np.bincount(part, nodes[node, k]) / members for k in range(3)], axis=1)
        distance = np.linalg.norm(nodes[node] - self._centre[part], axis=1)
        self._size = np.zeros(self.count)
        np.maximum.at(self._size, part, distance)

    def displacement(self, part: np.ndarray, node: np.ndarray) -> np.ndarray:
        """Displacements of nodes by the motions of their parts, (k, 3, 6)."""
        arm = (self._nodes[node] - self._centre[part]) / self._size[part][:, None]
        axes = np.broadcast_to(np.eye(3), (len(node), 3, 3))
        # w x arm = sum over axes of w_j (e_j x arm)
        turns = np.cross(axes, arm[:, None, :]).transpose(0, 2, 1)
        return np.concatenate([axes, turns], axis=2)


def _strainless_motions(parts: _Parts, fixed: np.ndarray) -> np.ndarray:
    """Independent motions of all parts without deformation, (6 parts, count)."""
    system = _ground(parts, fixed) + _joints(parts)
    if parts.count <= DENSE_PARTS:
        values, vectors = scipy.linalg.eigh(system.toarray())
    else:
        values, vectors = scipy.sparse.linalg.eigsh(system.tocsc(), k=6, sigma=-SINGULAR, which="LM")
    return vectors[:, values < SINGULAR]


def _ground(parts: _Parts, fixed: np.ndarray) -> scipy.sparse.coo_array:
    """`sum B^T B` over the fixed components of each part, by their number: `B` is their displacement."""
    held = fixed[parts.node].any(axis=1)
    part, node = parts.part[held], parts.node[held]
    rows = parts.displacement(part, node) * fixed[node][:, :, None]
    rows /= np.sqrt(np.bincount(part, minlength=parts.count)[part])[:, None, None]
    return _scattered([(part, part, np.einsum("kia,kib->kab", rows, rows))], parts.count)


def _joints(parts: _Parts) -> scipy.sparse.coo_array:
    """`sum B^T B` over the nodes that two parts share: `B` is the difference of their displacements."""
    order = np.argsort(parts.node, kind="stable")
    again = np.flatnonzero(np.diff(parts.node[order]) == 0)
    # A node of several parts joins each to the next.
    a, b, node = parts.part[order[again]], parts.part[order[again + 1]], parts.node[order[again]]
    _, pair, counts = np.unique(a * parts.count + b, return_inverse=True, return_counts=True)
    weight = 1.0 / np.sqrt(counts[pair])[:, None, None]
    of_a, of_b = (parts.displacement(p, node) * weight for p in (a, b))
    blocks = [
        (p, q, sign * np.einsum("kia,kib->kab", rows, columns))
        for p, q, sign, rows, columns in ((a, a, 1, of_a, of_a), (b, b, 1, of_b, of_b), (a, b, -1, of_a, of_b))
    ]
    blocks.append((b, a, blocks[-1][2].transpose(0, 2, 1)))
    return _scattered(blocks, parts.count)


def _scattered(blocks: list[tuple[np.ndarray, np.ndarray, np.ndarray]], count: int) -> scipy.sparse.csr_array:
    """Sum of 6 x 6 blocks at (row, column) in a matrix of ``count`` by ``count`` of them."""
    unknown = np.arange(6)
    row = [np.broadcast_to((6 * r[:, None] + unknown)[:, :, None], b.shape).ravel() for r, _, b in blocks]
    column = [np.broadcast_to((6 * c[:, None] + unknown)[:, None, :], b.shape).ravel() for _, c, b in blocks]
    values = np.concatenate([b.ravel() for _, _, b in blocks])
    shape = (6 * count, 6 * count)
    return scipy.sparse.coo_array((values, (np.concatenate(row), np.concatenate(column))), shape=shape).tocsr()
