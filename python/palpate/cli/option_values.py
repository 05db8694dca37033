"""Values of options; errors name the option."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import typer


def read_option(option: str, text: str, read: Callable[[str], Any]) -> Any:
    """Value of what was typed for an option; the UnitError of what cannot be read names the option."""
    from palpate.errors import UnitError

    try:
        return read(text)
    except UnitError as error:
        raise UnitError(f"{option}: {error}") from None


def require_unit(unit: str | None) -> None:
    """Refuse a unit that is no length, before the file is read."""
    from palpate.units import length_scale

    if unit is not None:
        read_option("--unit", unit, length_scale)


def finite(seconds: float | None) -> float | None:
    """Refuse a time without an end."""
    if seconds is not None and not math.isfinite(seconds):
        raise typer.BadParameter(f"{seconds} is not a number of seconds")
    return seconds
