"""Bodies of an exam: one for each place, radius, depth and contrast of a nodule, and the forces over each.

All bodies have the same mesh, only the materials of elements differ, so that neither the elements nor what is drawn of
them tells where the nodule is. Each has a store of its own in the cache: an interrupted preparation goes on where it
stopped.

Felt contrast. Pressed to the depth `d` the tool feels the secant stiffness `F/d`. Over a nodule that is
`dK/K = F / F0 - 1` harder than the body without one at the same place and depth, by the engine's own forces.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version

import numpy as np

from palpate.atomic import written_beside
from palpate.body import Body, Material, parse
from palpate.cache import cache_directory, digest
from palpate.errors import MeshError, SceneError
from palpate.exam.file import ExamFile
from palpate.exam.pressing import Places, forces_at, places_of
from palpate.exam.psychometric import Psychometrics
from palpate.green import GreensFunction, precompute
from palpate.mesh import TetMesh, shapes
from palpate.mesh.elements import FACES
from palpate.progress import progress_reporter
from palpate.scene import BuiltScene, unsolved_body

Progress = bool | Callable[[int, int], None]

# The body without a nodule has one all the same, of the tissue's own modulus but for this part of it: bodies of one
# material and of several are not weighed by the same formula in the contact law, and the difference, up to a per cent
# on coarse elements, would be felt.
NO_CONTRAST = 1.0 + 1e-9
# The elements of a nodule may fill so much more or less than its ball.
VOLUME_TOLERANCE = 0.25
# Smallest felt contrast of a nodule.
LEAST_CONTRAST = 1e-4


@dataclass(frozen=True)
class Nodule:
    """A ball that may be hidden."""

    place: int  # number of the place under which it lies
    # m; the depth is that of its middle.
    radius: float
    depth: float
    contrast: float  # its Young's modulus over that of the tissue around it


class Library:
    """All bodies of an exam, computed or from the cache.

    Parameters
    ----------
    exam
        What is asked.
    progress
        A bar on a terminal; a function is called with bodies done and in all.

    Attributes
    ----------
    exam, places
        The file, and where nodules may lie.
    nodules
        All of them.
    plain_forces
        (places,) N, of the tool pressed to the exam's depth at each place of the body without a nodule.
    forces
        (nodules, places) N, the same over each body.

    Raises
    ------
    Error
        Nodules that the mesh cannot hold, or a body that cannot be solved.

    """

    def __init__(self, exam: ExamFile, progress: Progress = True):
        self.exam = exam
        self._plain = unsolved_body(exam)
        self._touch = self._searched()
        table = exam.nodule
        first = Nodule(0, table.radii[0], table.depths[0], NO_CONTRAST)
        surface = self._plain.mesh
        self.places: Places = places_of(exam, surface, self._touch)
        self.nodules = [
            Nodule(place, radius, depth, contrast)
            for place in range(len(self.places.points))
            for radius in table.radii
            for depth in table.depths
            for contrast in table.contrast.values()
        ]
        with progress_reporter("preparing nodules", progress) as report:
            measured = self._measured([first, *self.nodules], report or (lambda done, total: None))
        self.plain_forces, self.forces = measured[0], measured[1:]

    @cached_property
    def felt_contrasts(self) -> np.ndarray:
        """(nodules,) relative change of the felt stiffness over each nodule, `dK/K`."""
        places = np.array([nodule.place for nodule in self.nodules])
        return self.forces[np.arange(len(places)), places] / self.plain_forces[places] - 1.0

    @cached_property
    def staircase_contrasts(self) -> np.ndarray:
        """(nodules,) felt contrasts, kept above zero for their logarithms: rounding may leave soft nodules none."""
        return np.maximum(self.felt_contrasts, LEAST_CONTRAST)

    @cached_property
    def psychometrics(self) -> Psychometrics:
        """Likelihoods of answers over every nodule."""
        return Psychometrics(self.felt_contrasts, len(self.places.points))

    @cached_property
    def groups(self) -> list[np.ndarray]:
        """Numbers of the nodules that differ by their contrast alone, for each place, radius and depth."""
        kinds: dict[tuple[int, float, float], list[int]] = {}
        for rank, nodule in enumerate(self.nodules):
            kinds.setdefault((nodule.place, nodule.radius, nodule.depth), []).append(rank)
        return [np.array(ranks) for ranks in kinds.values()]

    def built(self, nodule: int | None) -> BuiltScene:
        """Scene with a nodule, or with none.

        The page must not know the elements: the body is as one from a bare store.
        """
        table = self.exam.nodule
        chosen = Nodule(0, table.radii[0], table.depths[0], NO_CONTRAST) if nodule is None else self.nodules[nodule]
        return self._built(self._green(chosen))

    def _built(self, green: GreensFunction) -> BuiltScene:
        return BuiltScene.of(self.exam, None, GreensFunction.load(green.path))

    def _green(self, nodule: Nodule) -> GreensFunction:
        precision = self.exam.bodies[0].precision
        return precompute(self._body(nodule), touch=self._touch, precision=precision, progress=False)

    def _body(self, nodule: Nodule) -> Body:
        plain, points = self._plain, self.places
        middle = points.points[nodule.place] - nodule.depth * points.normals[nodule.place]
        ball = shapes.Sphere(middle.tolist(), nodule.radius)
        try:
            mesh = plain.mesh.with_regions({"hidden nodule": ball})
        except MeshError as error:
            raise self.exam.mistake(["nodule"], f"nodule: {error}") from None
        inside = mesh.regions == mesh.region_names["hidden nodule"]
        self._check(mesh, inside, nodule)
        centres = mesh.nodes[mesh.tets[:, :4]].mean(axis=1)
        closest = np.argmin(np.linalg.norm(centres - middle, axis=1))
        modulus, ratio, density = plain.element_materials[closest].tolist()
        hard = Material(modulus * nodule.contrast, ratio, density)
        left = np.setdiff1d(mesh.regions, mesh.region_names["hidden nodule"]).tolist()
        tissue = {k: Material(*plain.element_materials[plain.mesh.regions == k][0].tolist()) for k in left}
        return Body(mesh, material={**tissue, "hidden nodule": hard}, fixed=plain.fixed_mask)

    def _check(self, mesh: TetMesh, inside: np.ndarray, nodule: Nodule) -> None:
        """Refuse a nodule that is not what the file says in this mesh."""
        text = f"nodule: of radius {1e3 * nodule.radius:g} mm, {1e3 * nodule.depth:g} mm deep at place {nodule.place}"
        ball = 4.0 / 3.0 * np.pi * nodule.radius**3
        part = float(mesh.volumes[inside].sum()) / ball
        if abs(part - 1.0) > VOLUME_TOLERANCE:
            reason = f"its elements fill {100 * part:.0f} % of it: make them smaller with body.refine"
            raise self.exam.mistake(["nodule"], f"{text}: {reason}")
        corners = np.sort(mesh.tets[inside][:, FACES[4]], axis=2).reshape(-1, 3)
        outer = {tuple(face) for face in np.sort(mesh.surface_faces[:, :3], axis=1).tolist()}
        if any(tuple(face) in outer for face in corners.tolist()):
            reason = "an element of it reaches the surface: hide it deeper, or make elements smaller with body.refine"
            raise self.exam.mistake(["nodule"], f"{text}: {reason}")

    def _searched(self) -> np.ndarray:
        """Surface nodes that may be touched."""
        exam, plain = self.exam, self._plain
        surface = plain.mesh.surface_nodes
        chosen = surface[parse(exam.question.search)(plain.mesh.nodes[surface])]
        chosen = np.setdiff1d(chosen, plain.fixed_nodes)
        if len(chosen) == 0:
            raise exam.mistake(
                ["exam", "search"], f"exam.search: no free surface node satisfies '{exam.question.search}'"
            )
        return chosen

    def _measured(self, nodules: Sequence[Nodule], report: Callable[[int, int], None]) -> np.ndarray:
        """Return forces (nodules, places), N; those that are known already are not measured again."""
        known = _ForceCache(self.exam, self.places)
        rows = []
        for done, nodule in enumerate(nodules):
            report(done, len(nodules))
            green = self._green(nodule)
            row = known.forces.get(green.key)
            if row is None:
                row = forces_at(self._built(green), self.places, self.exam.question.press_depth).tolist()
                known.add(green.key, row)
            rows.append(row)
        report(len(nodules), len(nodules))
        forces = np.array(rows)
        most = self.exam.device.max_force
        if forces.max() >= most * (1 - 1e-9) or forces.min() <= 0.0:
            raise SceneError(
                f"exam.press_depth: forces of {forces.min():.3g} to {forces.max():.3g} N; they must lie between 0 and "
                f"the device's limit of {most:g} N at every place"
            )
        return forces


class _ForceCache:
    """Forces at the places of an exam by the key of the store, kept in a file of the cache."""

    def __init__(self, exam: ExamFile, places: Places):
        key = digest([version("palpate"), exam.force_settings(), places.points.tolist()])
        self._path = cache_directory() / f"{key[:32]}.felt.palpate"
        self.forces: dict[str, list[float]] = {}
        if self._path.exists():
            try:
                cached = json.loads(self._path.read_text())
                if cached["sum"] != digest(cached["forces"]):
                    raise ValueError("damaged")
                self.forces = cached["forces"]
            except (ValueError, KeyError, TypeError):
                self._path.unlink(missing_ok=True)

    def add(self, key: str, row: list[float]) -> None:
        self.forces[key] = row
        self._path.parent.mkdir(parents=True, exist_ok=True)
        with written_beside(self._path) as partial:
            partial.write_text(json.dumps({"forces": self.forces, "sum": digest(self.forces)}))
