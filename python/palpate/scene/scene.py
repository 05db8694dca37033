"""The scene file: TOML, checked key by key; quantities take units."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from palpate.errors import SceneError
from palpate.input_file import require_file
from palpate.scene.build import BuiltScene, build
from palpate.scene.mistakes import explain, located
from palpate.scene.tables import BodyTable, SceneTables

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib


class Scene(SceneTables):
    """What to touch, and with what.

    A file has ``[[body]]`` and ``[[tool]]`` tables, or a single ``[body]`` and ``[tool]``. The tables ``supports``,
    ``material``, ``region``, ``loads`` and ``dynamics`` of the scene are those of every body that has none of its own.
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
        require_file(path, SceneError)
        text = path.read_text(errors="replace")
        try:
            scene = cls(**tomllib.loads(text))
        except tomllib.TOMLDecodeError as error:
            raise SceneError(f"{path}: {error}") from None
        except SceneError as error:
            if not isinstance(error.__cause__, ValidationError):
                raise
            raise SceneError(explain(path, text, error.__cause__, cls)) from None
        scene._source = (path, text)
        for rank in range(len(scene.bodies)):
            scene._check_tables(rank)
        return scene

    def start_paths_in(self, folder: str | os.PathLike[str]) -> None:
        """Let the paths of a scene made by a program start in a folder."""
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
        own = {"material", "region", "loads", "dynamics", "supports"}
        given = body.model_fields_set & own
        if len(self.bodies) == 1:
            given |= self.model_fields_set & own
        if body.store is not None and given:
            raise SceneError(
                f"{path}: a store carries its own material, supports and loads, and cannot move: leave those tables out"
            )

    @classmethod
    def of_store(cls, path: str | os.PathLike[str]) -> Scene:
        """Scene of a precomputed store, with the default tool and device."""
        return cls(body=BodyTable(store=os.fspath(path)))

    def build(
        self,
        progress: bool | Callable[[int, int], None] = True,
        modes_progress: bool | Callable[[int, int], None] | None = None,
    ) -> BuiltScene:
        """Mesh if need be, precompute, and find the modes of bodies that move, or take it all from the cache.

        ``progress`` is shown, or told of done and expected; of modes ``modes_progress`` is, unless it is None.

        Raises
        ------
        Error
            A mesh that cannot be read or made, supports that leave it free to move, a store that does not match.

        """
        return build(self, progress, modes_progress)
