"""Fitness of a machine for a force loop at 1 kHz: ``palpate doctor``."""

from __future__ import annotations

from collections.abc import Callable

from palpate.devices import listings
from palpate.validation.doctor.advice import Advice, advice
from palpate.validation.doctor.machine import Machine, ProcessorTime, cpu_list, processor_time, read_machine
from palpate.validation.doctor.measure import PageRate, histogram, loop_times, page_rate
from palpate.validation.doctor.report import Report, as_json, as_text

__all__ = [
    "Advice",
    "Machine",
    "PageRate",
    "ProcessorTime",
    "Report",
    "advice",
    "as_json",
    "as_text",
    "cpu_list",
    "examine",
    "histogram",
    "loop_times",
    "page_rate",
    "processor_time",
    "read_machine",
]


def examine(seconds: float, report: Callable[[float], None] | None = None) -> Report:
    """Read the system's settings and measure; ``report`` is called with the seconds that the loop has run."""
    machine, before = read_machine(), processor_time()
    loop, ticks = loop_times(seconds, report)
    after = processor_time()
    taken = None if before is None or after is None else after.shares_since(before)
    advised = advice(machine, loop.priority, loop.locked_memory, taken)
    return Report(machine, seconds, loop, ticks, page_rate(), advised, taken, tuple(listings()))
