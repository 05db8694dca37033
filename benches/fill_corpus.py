"""Surfaces that people bring, made by a program: clean, damaged, thin, hollow, huge.

Each is 0.1 m large or a little less. The reference is the surface before it was damaged.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import trimesh

RADIUS = 0.04
COUNTS = (1_000, 10_000, 30_000, 100_000, 300_000, 1_000_000)


@dataclass(frozen=True)
class Given:
    """A surface, and the closed one that it stands for; None: it has no inside."""

    surface: trimesh.Trimesh
    truth: trimesh.Trimesh | None


@dataclass(frozen=True)
class Case:
    """A surface of the corpus.

    Attributes
    ----------
    name, kind
        What it is called, and what is wrong with it.
    make
        Makes it.
    thick
        Whether all of its walls are thicker than three cells of the grid, 1/27 of its longest side.

    """

    name: str
    kind: str
    make: Callable[[], Given]
    thick: bool = True


def corpus() -> list[Case]:
    """All surfaces."""
    return [*_closed(), *_open(), *_turned(), *_doubled(), *_crossing(), *_thin(), *_needles(), *_cad(), *_no_inside()]


def ball(triangles: int, seed: int = 0, bumps: float = 0.12) -> trimesh.Trimesh:
    """Bumpy ball of about so many triangles: rings of latitude, with a vertex at each pole."""
    rings = max(int(np.sqrt(triangles / 4)), 6)
    around = 2 * rings
    polar, turn = np.pi * np.arange(1, rings + 1) / (rings + 1), 2 * np.pi * np.arange(around) / around
    sine, cosine = np.sin(polar)[:, None], np.cos(polar)[:, None] + 0 * turn
    places = np.stack([sine * np.cos(turn), sine * np.sin(turn), cosine], axis=-1).reshape(-1, 3)
    places = np.vstack([places, [0, 0, 1], [0, 0, -1]])
    index = np.arange(rings * around).reshape(rings, around)
    a, b = index[:-1].ravel(), np.roll(index, -1, axis=1)[:-1].ravel()
    c, d = index[1:].ravel(), np.roll(index, -1, axis=1)[1:].ravel()
    first, last, north, south = index[0], index[-1], rings * around, rings * around + 1
    caps = [(np.full(around, north), first, np.roll(first, -1)), (np.full(around, south), np.roll(last, -1), last)]
    faces = np.concatenate([np.column_stack(corners) for corners in ((a, c, b), (b, c, d), *caps)])
    random = np.random.default_rng(seed)
    waves = random.normal(size=(6, 3)) * 3.0
    height = np.sin(places @ waves.T + random.uniform(0, 6, 6)).sum(axis=1) / 6.0
    return trimesh.Trimesh(RADIUS * (1.0 + bumps * height)[:, None] * places, faces, process=False)


def _same(make: Callable[[], trimesh.Trimesh]) -> Given:
    shape = make()
    return Given(shape, shape)


def _damaged(make: Callable[[], trimesh.Trimesh], damage: Callable[[np.ndarray, trimesh.Trimesh], np.ndarray]) -> Given:
    """Surface whose triangles (k, 3) are replaced."""
    truth = make()
    faces = damage(np.array(truth.faces), truth)
    return Given(trimesh.Trimesh(truth.vertices.copy(), faces, process=False), truth)


def _closed() -> list[Case]:
    cases = [
        Case(f"ball of {count:,}", "closed", partial(_same, partial(ball, count, seed)))
        for seed, count in enumerate(COUNTS)
    ]
    cases.append(Case("rough scan of 100,000", "closed", partial(_rough, 100_000)))
    cases.append(Case("inside out", "closed", partial(_damaged, partial(ball, 5_000), lambda f, _: f[:, ::-1])))
    cases.append(Case("ball with a cavity", "closed", _hollow))
    return cases


def _rough(triangles: int) -> Given:
    """Noise of a scanner, 0.1 mm, as large as the triangles."""
    truth = ball(triangles, 7)
    noise = np.random.default_rng(1).normal(scale=1e-4, size=truth.vertices.shape)
    return Given(trimesh.Trimesh(truth.vertices + noise, truth.faces, process=False), truth)


def _hollow() -> Given:
    outer, inner = ball(8_000), trimesh.creation.icosphere(subdivisions=4, radius=0.4 * RADIUS)
    inner.invert()
    return _same(lambda: trimesh.util.concatenate([outer, inner]))


def _open() -> list[Case]:
    """Holes: their number, and their radius over the ball's."""
    cases = []
    for count in (1_000, 10_000, 100_000):
        for holes, size in ((1, 0.1), (12, 0.06), (3, 0.25), (1, 0.5)):
            if size * np.sqrt(count) > 2:
                make = partial(_damaged, partial(ball, count, 11), partial(_holed, holes=holes, size=size))
                cases.append(Case(f"{holes} holes of {size:g} R in {count:,}", "holes", make))
    cases.append(Case("a twentieth missing of 10,000", "holes", partial(_damaged, partial(ball, 10_000), _thinned_out)))
    return cases


def _holed(faces: np.ndarray, truth: trimesh.Trimesh, holes: int, size: float) -> np.ndarray:
    directions = np.random.default_rng(3).normal(size=(holes, 3))
    centres = RADIUS * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    middles = truth.vertices[faces].mean(axis=1)
    away = np.linalg.norm(middles[:, None] - centres, axis=2).min(axis=1)
    return faces[away > size * RADIUS]


def _thinned_out(faces: np.ndarray, _: trimesh.Trimesh) -> np.ndarray:
    return faces[np.random.default_rng(4).uniform(size=len(faces)) > 0.05]


def _turned() -> list[Case]:
    """Triangles that were turned round, by their share."""
    cases = []
    for count in (1_000, 10_000, 50_000):
        for share in (0.01, 0.1, 0.4):
            make = partial(_damaged, partial(ball, count, 21), partial(_some_turned, share=share))
            cases.append(Case(f"{100 * share:.0f} % turned of {count:,}", "flipped", make))
    return cases


def _some_turned(faces: np.ndarray, _: trimesh.Trimesh, share: float) -> np.ndarray:
    turned = np.random.default_rng(5).uniform(size=len(faces)) < share
    return np.where(turned[:, None], faces[:, ::-1], faces)


def _doubled() -> list[Case]:
    cases = []
    for count in (1_000, 20_000):
        once = partial(_damaged, partial(ball, count, 31))
        cases += [
            Case(f"all doubled of {count:,}", "doubled", partial(once, lambda f, _: np.vstack([f, f]))),
            Case(f"some doubled of {count:,}", "doubled", partial(once, lambda f, _: np.vstack([f, f[::7]]))),
            Case(
                f"some doubled and turned of {count:,}",
                "doubled",
                partial(once, lambda f, _: np.vstack([f, f[::7, ::-1]])),
            ),
        ]
    cases.append(Case("soup of 20,000", "doubled", _soup))
    cases.append(Case("holes, turned, doubled and a bar", "doubled", _everything))
    return cases


def _soup() -> Given:
    """No vertex is shared; corners differ by a micrometre."""
    truth = ball(20_000, 33)
    corners = truth.vertices[truth.faces].reshape(-1, 3)
    corners = corners + np.random.default_rng(6).uniform(-5e-7, 5e-7, corners.shape)
    return Given(trimesh.Trimesh(corners, np.arange(len(corners)).reshape(-1, 3), process=False), truth)


def _everything() -> Given:
    given = _union(ball(10_000, 35), _bar())
    damaged = ball(10_000, 35)
    faces = _some_turned(_holed(np.array(damaged.faces), damaged, 3, 0.2), damaged, 0.05)
    damaged = trimesh.Trimesh(damaged.vertices, np.vstack([faces, faces[:200]]), process=False)
    return Given(trimesh.util.concatenate([damaged, _bar()]), given.truth)


def _bar() -> trimesh.Trimesh:
    return trimesh.creation.box(extents=(0.1, 0.024, 0.024))


def _union(*parts: trimesh.Trimesh) -> Given:
    """Parts as they are, through each other, and their union by manifold3d."""
    from manifold3d import Manifold, Mesh

    solids = [Manifold(Mesh(np.asarray(p.vertices, np.float32), np.asarray(p.faces, np.uint32))) for p in parts]
    union = sum(solids[1:], solids[0]).to_mesh()
    truth = trimesh.Trimesh(
        np.array(union.vert_properties, dtype=float)[:, :3], np.array(union.tri_verts), process=False
    )
    return Given(trimesh.util.concatenate(list(parts)), truth)


def _moved(mesh: trimesh.Trimesh, *offset: float) -> trimesh.Trimesh:
    moved = mesh.copy()
    moved.apply_translation(offset)
    return moved


def _crossing() -> list[Case]:
    small = partial(trimesh.creation.icosphere, subdivisions=4, radius=0.6 * RADIUS)
    torus = partial(trimesh.creation.torus, RADIUS, 0.3 * RADIUS, 96, 32)
    makes: dict[str, Callable[[], Given]] = {
        "ball and bar": lambda: _union(ball(5_000), _bar()),
        "three balls": lambda: _union(*(_moved(small(), 0.02 * k, 0.01 * (k % 2), 0) for k in (-1, 0, 1))),
        "ball in a ring": lambda: _union(torus(), _moved(small(), 0.03, 0, 0)),
        "two rings": lambda: _union(torus(), _moved(torus(), 0.03, 0, 0.008)),
        "the same ball twice, 1 mm apart": lambda: _union(ball(5_000), _moved(ball(5_000), 0.001, 0, 0)),
        "nested balls": lambda: Given(trimesh.util.concatenate([ball(5_000), small()]), ball(5_000)),
        "box cut by its own copy": lambda: _union(_bar(), _moved(_bar(), 0.02, 0.012, 0.012)),
        "two balls apart": lambda: Given(
            trimesh.util.concatenate([ball(5_000), _moved(small(), 0.1, 0, 0)]), ball(5_000)
        ),
        "a ball and ten crumbs": lambda: Given(
            trimesh.util.concatenate(
                [ball(5_000), *(_moved(trimesh.creation.box([2e-3] * 3), 0.05, 0.007 * k - 0.03, 0) for k in range(10))]
            ),
            ball(5_000),
        ),
    }
    return [Case(name, "several parts", make) for name, make in makes.items()]


def _thin() -> list[Case]:
    """Shells by their wall in parts of the diameter: a hollow ball with an opening, cut by a plane."""
    cases = []
    for parts in (8, 16, 32, 64, 128):
        cases.append(
            Case(f"bowl, wall 1/{parts}", "thin", partial(_same, partial(_bowl, 2 * RADIUS / parts)), parts < 27)
        )
    cases.append(Case("closed shell, wall 1/20", "thin", _shell, True))
    cases.append(Case("plate of 1/25 with a hole", "thin", partial(_same, _plate), False))
    cases.append(Case("bowl, wall 1/32, open rim", "thin", _open_bowl, False))
    return cases


def _bowl(wall: float) -> trimesh.Trimesh:
    angles = np.linspace(0, 0.55 * np.pi, 40)
    outside = RADIUS * np.column_stack([np.sin(angles), -np.cos(angles)])
    inside = (RADIUS - wall) * np.column_stack([np.sin(angles), -np.cos(angles)])[::-1]
    solid = trimesh.creation.revolve(np.vstack([outside, inside]), sections=96)
    solid.merge_vertices()
    solid.update_faces(solid.nondegenerate_faces())
    if solid.volume < 0:
        solid.invert()
    return solid


def _open_bowl() -> Given:
    truth = _bowl(2 * RADIUS / 32)
    middles = truth.vertices[truth.faces].mean(axis=1)
    return Given(
        trimesh.Trimesh(truth.vertices, truth.faces[middles[:, 2] < middles[:, 2].max() - 4e-4], process=False), truth
    )


def _shell() -> Given:
    outer = trimesh.creation.icosphere(subdivisions=5, radius=RADIUS)
    inner = trimesh.creation.icosphere(subdivisions=5, radius=0.9 * RADIUS)
    inner.invert()
    return _same(lambda: trimesh.util.concatenate([outer, inner]))


def _plate() -> trimesh.Trimesh:
    return _solid(
        lambda occ: occ.Box((0, 0, 0), (0.1, 0.06, 0.004)) - occ.Cylinder((0.05, 0.03, -0.01), occ.Z, r=0.01, h=0.03)
    )


def _needles() -> list[Case]:
    cylinder = partial(trimesh.creation.cylinder, radius=0.02, height=0.1, sections=2_000)
    return [
        Case("cylinder of 2,000 sides", "needles", partial(_same, cylinder)),
        Case(
            "cone of 2,000 sides", "needles", partial(_same, partial(trimesh.creation.cone, 0.03, 0.08, sections=2_000))
        ),
        Case("ball stretched in one band", "needles", _band),
        Case(
            "rod, 1 to 20",
            "needles",
            partial(_same, partial(trimesh.creation.cylinder, radius=0.0025, height=0.1, sections=64)),
            False,
        ),
        Case("box with split sides", "needles", _split_box),
    ]


def _band() -> Given:
    """Two rings of vertices a tenth of a micrometre apart."""
    sphere = ball(4_000)
    rings = np.unique(sphere.vertices[:, 2].round(6))
    middle = np.abs(sphere.vertices[:, 2]) < rings[rings > 0].min() * 3
    sphere.vertices[middle, 2] *= 1e-4
    return _same(lambda: sphere)


def _split_box() -> Given:
    """Each triangle is cut by points very near its edges."""
    box = trimesh.creation.box(extents=(0.08, 0.05, 0.05))
    corners = box.vertices[box.faces]
    near = 0.4999 * (corners[:, 0] + corners[:, 1]) + 0.0002 * corners[:, 2]
    index = len(box.vertices) + np.arange(len(box.faces))
    a, b, c = box.faces.T
    faces = np.vstack([np.column_stack(f) for f in ((a, b, index), (b, c, index), (c, a, index))])
    return _same(lambda: trimesh.Trimesh(np.vstack([box.vertices, near]), faces, process=False))


def _cad() -> list[Case]:
    def rounded(occ):
        box = occ.Box((0, 0, 0), (0.08, 0.05, 0.05))
        return box.MakeFillet(box.edges, 0.008)

    def bracket(occ):
        solid = occ.Box((0, 0, 0), (0.09, 0.05, 0.012)) + occ.Box((0, 0, 0), (0.012, 0.05, 0.06))
        return solid - occ.Cylinder((0.06, 0.025, -0.01), occ.Z, r=0.01, h=0.05)

    def pipe(occ):
        outer = occ.Cylinder((0, 0, 0), occ.Z, r=0.03, h=0.1)
        return outer - occ.Cylinder((0, 0, -0.01), occ.Z, r=0.02, h=0.12)

    def tee(occ):
        solid = occ.Cylinder((0, 0, 0), occ.Z, r=0.02, h=0.1) + occ.Cylinder((0, 0, 0.05), occ.X, r=0.015, h=0.06)
        return solid.MakeFillet(solid.edges, 0.002)

    makes = {"box with fillets": rounded, "bracket": bracket, "pipe": pipe, "tee with fillets": tee}
    cases = [Case(name, "CAD", partial(_same, partial(_solid, make))) for name, make in makes.items()]
    cases.append(
        Case("bracket, 29 % of it missing", "CAD", lambda: _damaged(lambda: _solid(bracket), lambda f, _: f[40:]))
    )
    return cases


def _solid(make: Callable) -> trimesh.Trimesh:
    """Boundary of a solid of OpenCascade, in triangles as CAD programs write them."""
    from netgen import occ
    from netgen.meshing import MeshingStep

    geometry = occ.OCCGeometry(make(occ))
    mesh = geometry.GenerateMesh(maxh=0.02, curvaturesafety=4, perfstepsend=MeshingStep.MESHSURFACE)
    points = np.array([point.p for point in mesh.Points()])
    faces = np.array([[vertex.nr - 1 for vertex in element.vertices] for element in mesh.Elements2D()])
    mesh = trimesh.Trimesh(points, faces, process=True)
    mesh.fix_normals()
    return mesh


def _no_inside() -> list[Case]:
    def sheet(rows: int, height: float) -> trimesh.Trimesh:
        x, y = np.meshgrid(np.linspace(0, 0.1, rows), np.linspace(0, 0.1, rows), indexing="ij")
        z = height * np.sin(40 * x) * np.cos(50 * y)
        a = (np.arange(rows - 1)[:, None] * rows + np.arange(rows - 1)).ravel()
        faces = np.vstack([np.column_stack([a, a + rows, a + 1]), np.column_stack([a + rows, a + rows + 1, a + 1])])
        return trimesh.Trimesh(np.column_stack([x.ravel(), y.ravel(), z.ravel()]), faces, process=False)

    pages = lambda: trimesh.util.concatenate([_moved(sheet(20, 0), 0, 0, 0.02 * k) for k in range(3)])  # noqa: E731
    makes = {"flat sheet": partial(sheet, 40, 0.0), "wavy sheet": partial(sheet, 60, 0.01), "three pages": pages}
    return [Case(name, "no inside", lambda make=make: Given(make(), None)) for name, make in makes.items()]
