"""Closed surfaces of known volume that meshers find hard: tubes, thin walls, holes."""

from __future__ import annotations

import numpy as np
import trimesh

MILLIMETRE = 1e-3


def torus(radius: float = 0.04, tube: float = 0.01) -> trimesh.Trimesh:
    """Of volume 2 pi^2 R r^2, less what its 96 x 32 facets cut off."""
    return trimesh.creation.torus(radius, tube, 96, 32)


def cup(radius: float = 0.035, height: float = 0.07, wall: float = 0.002) -> trimesh.Trimesh:
    """Open above."""
    rises = np.linspace(0, 1, 24)
    outside = np.column_stack([np.full(24, radius), height * rises])
    inside = np.column_stack([np.full(24, radius - wall), wall + (height - wall) * rises[::-1]])
    floor = np.linspace(0, radius, 12, endpoint=False)
    bottom, top = np.column_stack([floor, 0 * floor]), np.column_stack([floor[::-1], 0 * floor + wall])
    return trimesh.creation.revolve(np.vstack([bottom, outside, inside, top]), sections=72)


def knot(tube: float = 0.006, size: float = 0.015) -> trimesh.Trimesh:
    """Tube around a trefoil: circles in planes across the curve, turned so that they close."""
    t = np.linspace(0, 2 * np.pi, 240, endpoint=False)
    curve = size * np.column_stack([np.sin(t) + 2 * np.sin(2 * t), np.cos(t) - 2 * np.cos(2 * t), -np.sin(3 * t)])
    along = np.roll(curve, -1, axis=0) - np.roll(curve, 1, axis=0)
    along /= np.linalg.norm(along, axis=1)[:, None]
    # The plane's first axis points away from the knot's own axis, which the curve is never parallel to.
    first = curve * [1, 1, 0]
    first -= np.einsum("ij,ij->i", first, along)[:, None] * along
    first /= np.linalg.norm(first, axis=1)[:, None]
    angles = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    second = np.cross(along, first)
    ring = np.cos(angles)[:, None] * first[:, None] + np.sin(angles)[:, None] * second[:, None]
    points = (curve[:, None] + tube * ring).reshape(-1, 3)
    index = np.arange(len(points)).reshape(240, 24)
    a, b = index, np.roll(index, -1, axis=1)
    c, d = np.roll(index, -1, axis=0), np.roll(np.roll(index, -1, axis=0), -1, axis=1)
    faces = np.concatenate([np.stack(f, axis=-1).reshape(-1, 3) for f in ((a, b, d), (a, d, c))])
    shape = trimesh.Trimesh(points, faces, process=False)
    if shape.volume < 0:
        shape.invert()
    return shape


def bracket() -> trimesh.Trimesh:
    """Of two plates of 6 mm at a right angle, with two holes of 10 mm and one of 14 mm."""
    from netgen.occ import Box, Cylinder, OCCGeometry, Pnt, X, Z

    solid = Box(Pnt(0, 0, 0), Pnt(60, 40, 6)) + Box(Pnt(0, 0, 0), Pnt(6, 40, 50))
    solid -= Cylinder(Pnt(40, 12, -1), Z, r=5, h=8)
    solid -= Cylinder(Pnt(40, 28, -1), Z, r=5, h=8)
    solid -= Cylinder(Pnt(-1, 20, 35), X, r=7, h=8)
    mesh = OCCGeometry(solid).GenerateMesh(maxh=5, curvaturesafety=4)
    points = MILLIMETRE * np.array([point.p for point in mesh.Points()])
    faces = np.array([[vertex.nr - 1 for vertex in element.vertices] for element in mesh.Elements2D()])
    shape = trimesh.Trimesh(points, faces, process=True)
    shape.fix_normals()
    return shape
