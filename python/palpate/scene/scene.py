"""The scene file: TOML, checked key by key; quantities take units. The built-in models are scenes, too."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from palpate import models
from palpate.errors import SceneError
from palpate.green import BackgroundPrecompute
from palpate.input_file import read_toml
from palpate.scene.build import BuiltScene, build, marked_as_growing, require_files
from palpate.scene.mistakes import explain, located
from palpate.scene.regions import DEFAULT_LAW
from palpate.scene.series import with_series, with_stored_series
from palpate.scene.sizes import Expected
from palpate.scene.tables import BodyTable, SceneTables

if TYPE_CHECKING:
    from distributed import Client

# Size of a fingertip against each model, m; and its stiffness, Pa: organs about as published for fresh tissue
# (liver and kidney some kPa to tens of kPa), the others soft rubber.
TOOLS = {"doll": 10e-3, "kidney": 6e-3, "liver": 10e-3, "beam": 5e-3}
YOUNGS_MODULUS = {"doll": 10e3, "kidney": 15e3, "liver": 8e3, "beam": 20e3}
# Where a model is held to be pressed, if not on its own supports. The liver lies on its back: hung by its ligaments it
# swings as a whole (of a press of 5 mm a fifth arrives 5 cm away, lying it is a twelfth). The doll leans back too.
SUPPORTS = {"doll": "z < 6mm or y > 40mm", "liver": "y > 20mm"}
# Modes of a body in motion, by whether it has the paper's size: all of a small one, the lowest of a fine one.
MODES = {True: {"modes": "all"}, False: {"modes": 200}}
# Parts of critical damping of the first and the tenth mode: a struck body swings for some seconds.
DAMPING_RATIOS = (0.03, 0.03)


class Scene(SceneTables):
    """What to touch, and with what.

    A file has ``[[body]]`` and ``[[tool]]`` tables, or a single ``[body]`` and ``[tool]``. The tables ``supports``,
    ``touch``, ``material``, ``region``, ``loads`` and ``dynamics`` of the scene are those of every body that has none
    of its own.
    """

    def __init__(self, /, **tables: Any):
        try:
            super().__init__(**tables)
        except ValidationError as error:
            raise SceneError(explain(Path("Scene"), "", error, type(self))) from error

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Scene:
        """Read a scene file.

        Raises
        ------
        SceneError
            Missing, not TOML, or a wrong key or value, with its line.

        """
        path = Path(path)
        text, tables = read_toml(path, SceneError)
        try:
            scene = cls(**tables)
        except SceneError as error:
            if not isinstance(error.__cause__, ValidationError):
                raise
            raise SceneError(explain(path, text, error.__cause__, cls)) from None
        scene.replace_source(path, text)
        return scene

    def replace_source(self, path: Path, text: str) -> None:
        """Take a file for that of this scene: its folder is where paths start, its lines are where mistakes stand.

        Raises
        ------
        SceneError
            A body whose tables do not go together.

        """
        self._source = (path, text)
        for rank in range(len(self.bodies)):
            self._check_tables(rank)

    def start_paths_in(self, folder: str | os.PathLike[str]) -> None:
        """Set the folder in which relative paths of a scene start that a program has made."""
        self._source = (Path(folder) / self.name, "")

    def _check_tables(self, rank: int) -> None:
        """Refuse a mesh without supports, and a store with tables that it cannot obey."""
        body, (path, text) = self.bodies[rank], self.source
        supports = body.supports or self.supports
        if body.mesh is not None and supports.fixed is None:
            shared = ["supports"] if "supports" in self.model_fields_set else ["body", rank]
            place = ["body", rank, "supports"] if body.supports is not None else shared
            of_which = f" for body '{body.title}'" if len(self.bodies) > 1 else ""
            raise SceneError(f"{located(path, text, place)}: the key 'supports.fixed' is missing{of_which}")
        own = {"material", "region", "loads", "dynamics", "supports", "touch"}
        given = body.model_fields_set & own
        if len(self.bodies) == 1:
            given |= self.model_fields_set & own
        if body.store is not None and given:
            where = located(path, text, ["body", rank, "store"])
            raise SceneError(
                f"{where}: a store has its own material, supports, loads and touch region, and it cannot move: "
                "leave those tables out"
            )

    @classmethod
    def of_store(cls, path: str | os.PathLike[str]) -> Scene:
        """Scene of a precomputed store, with the default tool and device."""
        return cls(body=BodyTable(store=os.fspath(path)))

    def require_files(self) -> None:
        """Refuse what building it would refuse of its files, before anything is filled or solved.

        Raises
        ------
        Error
            A file that is missing or cannot be read, supports that hold no node, a region without elements.

        """
        require_files(self)

    def build(
        self,
        progress: bool | Callable[[int, int], None] = True,
        modes_progress: bool | Callable[[int, int], None] | None = None,
        announce: Callable[[Expected], None] | None = None,
    ) -> BuiltScene:
        """Mesh if need be, precompute, and find the modes of bodies that move, or take it all from the cache.

        ``progress`` shows a bar, or is called with the finished and the expected count; ``modes_progress`` likewise for
        modes, unless it is None.
        ``announce`` is called with the expected size of each body before it is computed.

        Raises
        ------
        Error
            A mesh that cannot be read or made, supports that leave it free to move, a store that does not match.

        """
        return with_stored_series(build(self, progress, modes_progress, announce=announce))

    def precompute(
        self,
        progress: bool | Callable[[int, int], None] = True,
        announce: Callable[[Expected], None] | None = None,
        dask: str | Client | None = None,
    ) -> BuiltScene:
        """Build, with all of the series beyond small strain, so that nothing is left to be computed beside a loop.

        With ``dask`` the workers of a cluster compute the Green's functions and the series, as in
        :func:`palpate.precompute`. The modes of bodies that move are found here.

        Raises
        ------
        Error
            As of :meth:`build`.
        ClusterError
            A cluster that cannot be reached, has no workers or other versions, or fails.

        """
        return with_series(build(self, progress, None, announce=announce, dask=dask), progress, dask)

    def build_first(
        self, progress: bool | Callable[[int, int], None] = True, announce: Callable[[Expected], None] | None = None
    ) -> tuple[BuiltScene, dict[int, BackgroundPrecompute]]:
        """Build the part that is touched first, and compute the rest in other processes.

        Bodies without ``touch.first``, and those whose store is there, are built as a whole.

        Raises
        ------
        Error
            As of :meth:`build`.

        """
        growing: dict[int, BackgroundPrecompute] = {}
        try:
            built = build(self, progress, None, growing, announce)
            return with_stored_series(marked_as_growing(built, growing)), growing
        except BaseException:
            for background in growing.values():
                background.close()
            raise


def model_scene(name: str, paper: bool = False, motion: bool = False) -> Scene:
    """Scene of a built-in model and two fingers, held so that a finger dents it; with ``motion`` it moves.

    Raises SceneError for no model of that name.
    """
    if name not in models.NAMES:
        raise SceneError(f"there is no model '{name}'; there are {', '.join(models.NAMES)}")
    # What slides has no patch of its own; the radius is that of a grab.
    finger = {"contact": "local", "radius": TOOLS[name], "contact_radius": TOOLS[name]}
    return Scene(
        body={"model": name, "paper": paper},
        supports={"fixed": SUPPORTS.get(name)},
        # The paper's bodies are linear.
        material={"youngs_modulus": YOUNGS_MODULUS[name], "law": "linear" if paper else DEFAULT_LAW},
        tool=[finger, finger],
        dynamics={**MODES[paper], "damping_ratios": DAMPING_RATIOS} if motion else None,
    )
