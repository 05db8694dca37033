"""Results of a benchmark: figures with their targets, and plots."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path


@dataclass(frozen=True)
class Check:
    """One figure beside its target."""

    quantity: str  # what it is, with what it was computed on
    # In ``unit``; a target of zero makes the error absolute.
    computed: float
    target: float
    source: str  # where the target comes from
    tolerance: float | None  # largest error that passes; None shows the figure without a verdict
    unit: str = ""

    @property
    def error(self) -> float:
        """Difference relative to the target; to one if that is zero."""
        return abs(self.computed - self.target) / (abs(self.target) or 1.0)

    @property
    def passed(self) -> bool:
        """Within the tolerance, or without one."""
        return self.tolerance is None or self.error <= self.tolerance


@dataclass(frozen=True)
class Outcome:
    """Checks of a benchmark, and its plots by file name: functions that draw into a path."""

    checks: list[Check]
    plots: dict[str, Callable[[Path], None]] = field(default_factory=dict)


@dataclass(frozen=True)
class Benchmark:
    """A benchmark by name; ``slow`` ones take more than a few seconds."""

    name: str
    title: str
    run: Callable[[], Outcome]
    slow: bool = False
