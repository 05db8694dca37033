"""Base classes of the tables of a scene file: quantities with units, no unknown keys."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field

from palpate import units
from palpate.errors import Error
from palpate.units import brief_repr


@contextlib.contextmanager
def explained() -> Iterator[None]:
    """Turn an Error into the ValueError that pydantic takes for a mistake in the table."""
    try:
        yield
    except Error as error:
        raise ValueError(str(error)) from None


def _quantity(read: Callable[[Any], float]) -> BeforeValidator:
    def convert(value: Any) -> float:
        with explained():
            return read(value)

    return BeforeValidator(convert)


def _of_length_one(given: tuple[float, ...]) -> tuple[float, ...]:
    if abs(np.linalg.norm(given) - 1.0) > 1e-6:
        raise ValueError(f"must be a unit quaternion w x y z, got {list(given)}")
    return given


Length = Annotated[float, _quantity(units.length), Field(gt=0, allow_inf_nan=False)]
Radius = Annotated[float, _quantity(units.length), Field(ge=0, allow_inf_nan=False)]
Coordinate = Annotated[float, _quantity(units.length), Field(allow_inf_nan=False)]
Pressure = Annotated[float, _quantity(units.pressure), Field(gt=0, allow_inf_nan=False)]
SignedPressure = Annotated[float, _quantity(units.pressure), Field(allow_inf_nan=False)]
Density = Annotated[float, _quantity(units.density), Field(ge=0, allow_inf_nan=False)]
Force = Annotated[float, _quantity(units.force), Field(gt=0, allow_inf_nan=False)]
SignedForce = Annotated[float, _quantity(units.force), Field(allow_inf_nan=False)]
Stiffness = Annotated[float, _quantity(units.stiffness), Field(gt=0, allow_inf_nan=False)]
Time = Annotated[float, _quantity(units.time), Field(ge=0, allow_inf_nan=False)]
PoissonsRatio = Annotated[float, Field(gt=-1, lt=0.5)]
_Acceleration = Annotated[float, _quantity(units.acceleration), Field(allow_inf_nan=False)]
Share = Annotated[float, _quantity(units.share), Field(ge=0, lt=1)]
Number = Annotated[float, Field(allow_inf_nan=False)]

Orientation = Annotated[tuple[Number, Number, Number, Number], AfterValidator(_of_length_one)]
Point = tuple[Coordinate, Coordinate, Coordinate]
Direction = tuple[Number, Number, Number]
Acceleration = tuple[_Acceleration, _Acceleration, _Acceleration]
ForceVector = tuple[SignedForce, SignedForce, SignedForce]


def one_of(what: str, allowed: Callable[[Any], bool]) -> BeforeValidator:
    """Check a value that may be of several kinds: pydantic would explain every kind that it is not."""

    def check(value: Any) -> Any:
        if not allowed(value):
            raise ValueError(f"give {what}; got {brief_repr(value)}")
        return value

    return BeforeValidator(check)


class TableError(ValueError):
    """A mistake that shows only beside other tables, and the place in the file at which it stands."""

    def __init__(self, message: str, place: tuple[str | int, ...]):
        super().__init__(message)
        self.place = place


def is_whole(value: Any, least: int = 0) -> bool:
    """Whether a value is a whole number of at least ``least``."""
    return isinstance(value, int) and not isinstance(value, bool) and value >= least


class Table(BaseModel):
    """A table of the file: unknown keys are mistakes."""

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)
