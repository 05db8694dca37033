"""What a machine can give a force loop at 1 kHz: ``palpate doctor``."""

from __future__ import annotations

from collections.abc import Callable

from palpate.validation.doctor.advice import Advice, advice
from palpate.validation.doctor.machine import Machine, cpu_list, read_machine
from palpate.validation.doctor.measure import PageRate, histogram, loop_times, page_rate
from palpate.validation.doctor.report import Report, as_json, as_text

__all__ = [
    "Advice",
    "Machine",
    "PageRate",
    "Report",
    "advice",
    "as_json",
    "as_text",
    "cpu_list",
    "examine",
    "histogram",
    "loop_times",
    "page_rate",
    "read_machine",
]


def examine(seconds: float, report: Callable[[float], None] | None = None) -> Report:
    """Read what the system tells and measure; ``report`` is told the seconds that the loop has run."""
    machine = read_machine()
    loop, ticks = loop_times(seconds, report)
    return Report(machine, seconds, loop, ticks, page_rate(), advice(machine, loop.priority, loop.locked_memory))
