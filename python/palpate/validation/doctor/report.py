"""Report of doctor: the machine, the measurements, the verdict and the advice, for a person and as JSON."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from palpate.devices import Listing, listings
from palpate.simulation.scheduling import cpu_ranges
from palpate.validation.doctor.advice import Advice, advice
from palpate.validation.doctor.machine import UNLIMITED, Machine, processor_time, read_machine
from palpate.validation.doctor.measure import PageRate, histogram, loop_times, page_rate
from palpate.validation.ticks import LoopTimes, Times

SCHEMA = 1
PERIOD_US = 1000.0
# A device holds its last force through a deadline that is missed. One in a hundred, or a gap beyond which the safety
# stage takes a tick for an overrun (`max_compute`, 0.1 s), is no longer a surface to the hand.
MOST_MISSED, LONGEST_GAP_US = 0.01, 1e5
BAR = 40
NOT_AVAILABLE = "not available"


@dataclass(frozen=True, eq=False)
class Report:
    """All of it."""

    machine: Machine
    seconds: float  # how long the loop ran
    loop: LoopTimes
    ticks: dict[str, Times]  # of every kind of tick, played offline, us
    page: PageRate
    advice: list[Advice]  # most important first
    # Shares of the processors' time that programs took while the loop ran, and that the host of a virtual machine took;
    # None where the system does not report.
    taken: tuple[float, float] | None = None
    devices: tuple[Listing, ...] = ()  # haptic ones, by the drivers that look for them

    @property
    def missed(self) -> float:
        """Share of the deadlines that passed without a tick."""
        missed = self.loop.missed_computing + self.loop.missed_waking
        return missed / max(1, missed + len(self.loop.wakeup_us))

    @property
    def verdict(self) -> str:
        """``fit``, ``fit with misses`` or ``not fit``."""
        longest = float(self.loop.wakeup_us.max())
        too_slow = max(times.median for times in self.ticks.values()) > PERIOD_US
        if too_slow or self.missed > MOST_MISSED or longest > LONGEST_GAP_US:
            return "not fit"
        return "fit" if self.missed == 0 else "fit with misses"


def examine(seconds: float, report: Callable[[float], None] | None = None) -> Report:
    """Read the system's settings and measure; ``report`` is called with the seconds that the loop has run."""
    machine, before = read_machine(), processor_time()
    loop, ticks = loop_times(seconds, report)
    after = processor_time()
    taken = None if before is None or after is None else after.shares_since(before)
    advised = advice(machine, loop.priority, loop.locked_memory, taken)
    return Report(machine, seconds, loop, ticks, page_rate(), advised, taken, tuple(listings()))


def as_json(report: Report) -> dict[str, Any]:
    """Report with stable keys; times in us, memory in bytes. What the system does not report is null."""
    loop = report.loop
    return {
        "schema": SCHEMA,
        "verdict": report.verdict,
        "machine": asdict(report.machine),
        "loop": {
            "seconds": report.seconds,
            "priority": loop.priority,
            "locked_memory": loop.locked_memory,
            "missed_computing": loop.missed_computing,
            "missed_waking": loop.missed_waking,
            "missed_share": report.missed,
            "busy_share": report.taken and report.taken[0],
            "stolen_share": report.taken and report.taken[1],
            "wakeup": asdict(Times.of(loop.wakeup_us)),
            "compute": asdict(Times.of(loop.compute_us)),
            "wakeup_histogram": [
                {"from": low, "to": high, "count": count} for low, high, count in histogram(loop.wakeup_us)
            ],
        },
        "ticks": {kind: asdict(times) for kind, times in report.ticks.items()},
        "page": asdict(report.page),
        "devices": {
            listing.kind: {"found": len(listing.found), "ready": len(listing.ready)} for listing in report.devices
        },
        "advice": [asdict(one) for one in report.advice],
    }


def as_text(report: Report) -> str:
    """Report for a person."""
    return "\n".join([*_machine_lines(report), "", *_loop_lines(report), "", *_tick_lines(report), "", *_last(report)])


def _known(value: object, text: str | None = None) -> str:
    return NOT_AVAILABLE if value is None else (text if text is not None else str(value))


def _yes(value: bool | None) -> str:
    return NOT_AVAILABLE if value is None else ("yes" if value else "no")


def _limit_text(value: int | None, capability: bool | None, unit: int = 1, name: str = "") -> str:
    """Limit, and whether the process may pass it by."""
    if value is None and capability is None:
        return NOT_AVAILABLE
    size = "unlimited" if value == UNLIMITED else f"{(value or 0) / unit:g}{name}"
    return f"limit {size}{', passed by with a capability' if capability else ''}"


def _cpus_text(cpus: tuple[int, ...] | None) -> str:
    return NOT_AVAILABLE if cpus is None else cpu_ranges(cpus) or "none"


def _machine_lines(report: Report) -> Iterator[str]:
    m, loop = report.machine, report.loop
    priority = f"{'granted' if loop.priority else 'not granted'} (SCHED_FIFO)"
    frequency = m.frequency_mhz and f"{m.frequency_mhz[0]:.0f} to {m.frequency_mhz[1]:.0f} MHz"
    governors = None if m.governors is None else ", ".join(m.governors) or "frequency is not scaled by this system"
    quota = "none" if m.cpu_quota is None else f"{m.cpu_quota:g} CPUs"
    rows = {
        "system": f"{m.system} {m.kernel}",
        "processor": f"{_known(m.processor)}, {_known(m.cpus)} CPUs, {_cpus_text(m.allowed_cpus)} for this process",
        "real-time priority": f"{priority}; {_limit_text(m.rtprio_limit, m.sys_nice)}",
        "locked memory": f"{'granted' if loop.locked_memory else 'not granted'}; "
        f"{_limit_text(m.memlock_limit, m.ipc_lock, 2**20, ' MiB')}",
        "rtkit": _yes(m.rtkit),
        "kernel": f"{_known(m.preemption)}; tick: {_known(m.timer_hz, f'{m.timer_hz} Hz')}; "
        f"high-resolution timers: {_yes(m.high_resolution_timers)}",
        "frequency": f"{_known(governors)}; {_known(frequency)}",
        "isolated CPUs": f"{_cpus_text(m.isolated_cpus)}; without a tick (nohz_full): {_cpus_text(m.tickless_cpus)}",
        "SMT": _yes(m.smt),
        "virtual machine": _known(m.hypervisor, m.hypervisor or "no"),
        "container": f"{_known(m.container, m.container or 'no')}; CPU quota: {quota}",
        "clock": _known(m.clock_source),
    }
    return (f"{name + ':':20s}{value}" for name, value in rows.items())


def _loop_lines(report: Report) -> Iterator[str]:
    loop = report.loop
    yield f"wake-up of the loop's thread over {report.seconds:g} s, from the deadline to the begin of the tick:"
    bins = histogram(loop.wakeup_us)
    # Logarithmic: one late tick in thirty thousand is what is looked for.
    most = np.log10(1.0 + max(count for _, _, count in bins))
    for low, high, count in bins:
        bar = "#" * int(np.ceil(BAR * np.log10(1.0 + count) / most))
        yield f"  {low:7.0f} to {high:7.0f} us {count:7d}  {bar}"
    for name, times in (("wake-up", Times.of(loop.wakeup_us)), ("computing", Times.of(loop.compute_us))):
        yield f"  {name + ':':10s} median {times.median:.0f} us, p99.9 {times.p999:.0f} us, worst {times.worst:.0f} us"
    if report.taken is not None:
        busy, stolen = (100 * share for share in report.taken)
        yield f"  processors meanwhile: {busy:.0f} % busy, {stolen:.1f} % taken by the host of a virtual machine"
    yield f"  deadlines missed: {loop.missed_waking} by waking up late, {loop.missed_computing} by computing"


def _tick_lines(report: Report) -> Iterator[str]:
    yield "a tick of one sliding sphere, us of its thread:"
    yield f"  {'':10s}{'median':>9s}{'p99.9':>9s}{'worst':>9s}"
    for kind, times in report.ticks.items():
        yield f"  {kind:10s}{times.median:9.1f}{times.p999:9.1f}{times.worst:9.1f}"


def _last(report: Report) -> Iterator[str]:
    page = report.page
    drawn = "not measured (it takes Chromium and Playwright)"
    if page.drawn_per_second is not None:
        drawn = f"{page.drawn_per_second:.0f} frames a second, drawn in software by a Chromium without a screen"
    served = page.served_per_second
    yield f"page: {drawn}; served over the websocket: {'not measured' if served is None else f'{served:.0f} a second'}"
    counts = ", ".join(f"{listing.kind} {len(listing.ready) or 'none'}" for listing in report.devices)
    yield f"haptic devices ready: {counts or NOT_AVAILABLE} ('palpate devices' shows why)"
    if report.advice:
        yield ""
        yield "what to change, the most important first:"
    for rank, one in enumerate(report.advice, 1):
        yield f"{rank:3d}. {one.finding}"
        yield from (f"       {line}" for line in one.remedy)
    yield ""
    loop = report.loop
    missed, ticks = loop.missed_waking + loop.missed_computing, len(loop.wakeup_us)
    yield f"1 kHz: {report.verdict}" + (f" ({missed} of {missed + ticks} deadlines missed)" if missed else "")
