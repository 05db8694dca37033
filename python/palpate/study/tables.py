"""Tables of the study file: those of a scene with one body at rest, and the presses that every body is asked for."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BeforeValidator, Field, field_validator, model_validator

from palpate.scene import Scene
from palpate.scene.table import Coordinate, Point, Radius, Table

# A component in the file that the press leaves free.
FREE = "-"

Component = Annotated[Coordinate | None, BeforeValidator(lambda value: None if value == FREE else value)]


class PressTable(Table):
    """A press: the surface closest to ``point`` (m, in the frame of the body) is moved by ``displacement`` (m).

    A component of ``"-"`` is left free. ``radius`` (m) is that of the patch, 0 a point; by default a sixteenth of the
    body's longest side.
    """

    name: str | None = None
    """Name in the table of results."""
    point: Point
    """Point near the pressed place of the surface."""
    displacement: tuple[Component, Component, Component]
    """Displacement of the patch; `"-"` leaves a component free."""
    radius: Radius | None = None
    """Radius of the patch; 0 is a point. Default: a sixteenth of the longest side of the body."""

    @model_validator(mode="after")
    def _presses(self) -> PressTable:
        if not any(self.displacement):
            raise ValueError("a press needs a displacement: give a component other than 0 and '-'")
        return self


class StudyScene(Scene):
    """One body of a study, with what is asked of it."""

    presses: list[PressTable] = Field(alias="press", min_length=1)

    @field_validator("presses", mode="before")
    @classmethod
    def _single_press(cls, tables: Any) -> Any:
        """Take a single table as the only entry."""
        return tables if isinstance(tables, list) else [tables]


class StudyTables(StudyScene):
    """Everything that may stand in the file."""

    grid: dict[str, Any] = Field(default_factory=dict)
    cases: list[dict[str, Any]] = Field(default_factory=list, alias="case")
