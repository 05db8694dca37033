"""The exam file: a scene file with two additional tables, for the hidden nodules and for the questions."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field, model_validator

from palpate.errors import SceneError
from palpate.scene import Scene
from palpate.scene.mistakes import located
from palpate.scene.table import Length, Point, Table
from palpate.scene.tool_shape import KEYS

# Nodules that may be hidden, each a store of some megabytes and a second or more of computing.
MOST_BODIES = 1000

Share = Annotated[float, Field(gt=0, lt=1)]


class ContrastTable(Table):
    """Young's moduli of nodules over that of the tissue, ``E/E0``: so many, from ``low`` to ``high``.

    The steps are equal ratios of what a nodule is harder by, `E/E0 - 1`: as long as that is small the felt contrast is
    proportional to it.
    """

    low: Annotated[float, Field(gt=1, allow_inf_nan=False)] = 1.1
    """Smallest ratio of Young's moduli, nodule to tissue."""
    high: Annotated[float, Field(gt=1, allow_inf_nan=False)] = 25.0
    """Largest ratio."""
    count: Annotated[int, Field(ge=2, le=40)] = 8
    """Number of ratios from `low` to `high`."""

    @model_validator(mode="after")
    def _ascending(self) -> ContrastTable:
        if self.low >= self.high:
            raise ValueError(f"high must be above low, got {self.low:g} and {self.high:g}")
        return self

    def values(self) -> tuple[float, ...]:
        """Return the ratios, ascending."""
        return tuple((1.0 + np.geomspace(self.low - 1.0, self.high - 1.0, self.count)).tolist())


class NoduleTable(Table):
    """What is hidden: balls of every radius at every depth, m. A depth is that of the middle below the surface."""

    radii: Annotated[list[Length], Field(min_length=1)]
    """Radii of the hidden balls."""
    depths: Annotated[list[Length], Field(min_length=1)]
    """Depths of their centres below the surface."""
    contrast: ContrastTable = ContrastTable()
    """Young's moduli of the balls."""

    @model_validator(mode="after")
    def _covered(self) -> NoduleTable:
        if min(self.depths) <= max(self.radii):
            raise ValueError(
                f"a nodule of radius {max(self.radii):g} m whose middle is {min(self.depths):g} m deep would stick out"
            )
        return self


class RandomTable(Table):
    """Places drawn once for a file, on the searched surface within a box, no closer to each other than ``apart``."""

    count: Annotated[int, Field(ge=2, le=40)]
    """Number of places."""
    seed: Annotated[int, Field(ge=0)] = 0
    """Seed of the places. They are the same for every person."""
    low: Point
    """Lower corner of the box in which places lie."""
    high: Point
    """Upper corner of the box."""
    apart: Length
    """Smallest distance between two places."""

    @model_validator(mode="after")
    def _box(self) -> RandomTable:
        if not all(low <= high for low, high in zip(self.low, self.high, strict=True)):
            raise ValueError("the box must reach from its low to its high corner")
        return self


class QuestionTable(Table):
    """How it is asked for.

    Places (m, in the frame of the body) are taken to the closest point of the surface. They are the alternatives of
    the task: a mark counts for the closest of them. ``show_places`` draws them; without it a person searches.
    ``press_depth`` is where the stiffness that is felt is compared. ``target`` is the probability of a right answer
    that the staircase seeks. ``blanks`` are trials with nothing hidden. ``pass_weber_fraction`` is the largest Weber
    fraction that passes.
    """

    search: str
    """Part of the surface that may be touched: a predicate."""
    press_depth: Length
    """Depth at which felt stiffness is compared."""
    places: Annotated[list[Point] | None, Field(min_length=2)] = None
    """Points near the places under which nodules lie, in place of `[exam.random]`."""
    random: RandomTable | None = None
    """Places at random."""
    show_places: bool = True
    """Whether the page marks the places."""
    trials: Annotated[int, Field(ge=1, le=1000)] = 80
    """Trials with a nodule."""
    blanks: Annotated[int, Field(ge=0, le=1000)] = 0
    """Trials without a nodule."""
    target: Share = 0.75
    """Share of right answers that the staircase seeks."""
    pass_weber_fraction: Annotated[float | None, Field(gt=0, allow_inf_nan=False)] = None
    """Largest Weber fraction with which the exam is passed. Default: no criterion."""
    seed: Annotated[int | None, Field(ge=0)] = None
    """Seed of the exam. Default: another exam each time."""

    @model_validator(mode="after")
    def _one_kind_of_place(self) -> QuestionTable:
        if (self.places is None) == (self.random is None):
            raise ValueError("give either places or a table [exam.random]")
        if self.target <= 1.0 / self.alternatives:
            raise ValueError(
                f"target must be above the chance of a guess, 1 of {self.alternatives}, got {self.target:g}"
            )
        return self

    @property
    def alternatives(self) -> int:
        """How many places there are."""
        return self.random.count if self.random is not None else len(self.places or ())


class ExamFile(Scene):
    """An exam: a scene with one body at rest and one tool, and the tables ``exam`` and ``nodule``.

    The limit of strain is off, for a tool that it holds would not feel the nodule.
    """

    question: QuestionTable = Field(alias="exam")
    nodule: NoduleTable

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> ExamFile:
        """Read an exam file; SceneError if it is missing, not TOML, or has a wrong key or value, with its line."""
        exam = super().read(path)
        assert isinstance(exam, cls)
        exam._check()
        plain = exam.model_copy(update={"view": exam.view.model_copy(update={"strain_limit": 0.0})})
        plain._source = exam.source
        return plain

    @classmethod
    def default(cls) -> ExamFile:
        """Return the exam that comes with the package: a slab of soft tissue with four places."""
        return cls.read(Path(__file__).parent / "data" / "nodule.toml")

    def _check(self) -> None:
        """Refuse what an exam cannot have."""
        body, shape, nodule = self.bodies[0], self.tools[0].shape, self.nodule
        count = self.question.alternatives * len(nodule.radii) * len(nodule.depths) * nodule.contrast.count
        sags = "loads: a body of an exam has none, for it would sag less around a nodule, and an eye could see that"
        known = f"tool.shape: an exam takes {', '.join(KEYS)}, not a surface file"
        many = f"nodule: {count} nodules by place, radius, depth and contrast; an exam takes at most {MOST_BODIES}"
        for holds, place, message in (
            (len(self.bodies) == 1, ["body", 1], "body: an exam has one body"),
            (len(self.tools) == 1, ["tool", 1], "tool: an exam has one tool"),
            (body.store is None, ["body", 0, "store"], "body.store: a store has no inside"),
            ((body.dynamics or self.dynamics) is None, ["dynamics"], "dynamics: the body of an exam is at rest"),
            (not (self.loads or body.loads), ["loads"], sags),
            (shape in KEYS, ["tool", 0, "shape"], known),
            (count <= MOST_BODIES, ["nodule"], many),
        ):
            if not holds:
                raise self.mistake(place, message)

    def mistake(self, place: list[str | int], message: str) -> SceneError:
        """Return the error of a place in the file."""
        path, text = self.source
        return SceneError(f"{located(path, text, place)}: {message}")

    @property
    def title(self) -> str:
        """What the exam is called: the file without its ending."""
        return Path(self.source[0]).stem

    def force_settings(self) -> dict[str, Any]:
        """Return what decides the forces at given places of a given body."""
        return {
            "tool": self.tools[0].model_dump(mode="json"),
            "device": self.device.model_dump(mode="json"),
            "press_depth": self.question.press_depth,
        }
