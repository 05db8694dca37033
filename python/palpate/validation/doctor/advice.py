"""Advice: changes to a machine so that a loop at 1 kHz keeps its deadlines, in order of importance.

The order is that of what each takes from a loop at the worst: without a real-time priority any other program stays
before it for milliseconds, a quota stops it for tens of them, a processor that shares or sleeps costs tens of
microseconds.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from palpate.simulation.scheduling import cpu_ranges
from palpate.validation.doctor.machine import UNLIMITED, Machine

# Below this locked memory may be refused to a loop, bytes: it locks what a tick reads, for each body a store of up to
# 2 GB, or the touchable part of a larger one.
ENOUGH_MEMORY = 4 * 2**30
# The loop itself takes a few per cent of one processor; beyond this others come in its way.
BUSY = 0.5
# Clocks that are read without a call of the kernel, or by a fast one.
FAST_CLOCKS = {
    "tsc",
    "kvm-clock",
    "hyperv_clocksource_tsc_page",
    "arch_sys_counter",
    "xen",
    "timebase",
    "riscv_clocksource",
}


@dataclass(frozen=True)
class Advice:
    """Something to change."""

    key: str  # stable name
    finding: str  # what is so
    remedy: tuple[str, ...]  # commands or lines of files, one an entry; words that are no command begin with ``#``


def advice(
    machine: Machine, priority: bool | None, locked_memory: bool | None, taken: tuple[float, float] | None = None
) -> list[Advice]:
    """Everything that would help, most important first.

    ``priority`` and ``locked_memory`` are what the system granted a running loop; None where none has run. ``taken``
    are the shares of the processors' time that all programs took meanwhile, and that the host of a virtual machine
    took.
    """
    if machine.system != "Linux":
        finding = f"on {machine.system} real-time scheduling and locked memory are not set up by the loop"
        return [Advice("system", finding, ("# run the force loop on Linux",))]
    return [
        *_priority(machine, priority),
        *_processor_time(machine, taken),
        *_memory(machine, locked_memory),
        *_governor(machine),
        *_guest(machine, taken),
        *_kernel(machine),
        *_isolation(machine),
        *_hardware(machine),
    ]


def _priority(machine: Machine, granted: bool | None) -> Iterator[Advice]:
    allowed = machine.realtime_allowed if granted is None else granted
    if allowed is not False:
        return
    user = machine.user or "<user>"
    if machine.container:
        yield Advice(
            "realtime-priority",
            f"the container ({machine.container}) grants no real-time priority (SCHED_FIFO)",
            ("docker run --cap-add=SYS_NICE --ulimit rtprio=99 --ulimit memlock=-1 ...",),
        )
        return
    remedy = [
        f"echo '{user} - rtprio 95' | sudo tee /etc/security/limits.d/90-palpate.conf",
        f"echo '{user} - memlock unlimited' | sudo tee -a /etc/security/limits.d/90-palpate.conf",
        "# log out and in again; check with: ulimit -r",
        "# of a systemd service instead: LimitRTPRIO=95 and LimitMEMLOCK=infinity",
    ]
    if machine.realtime_allowed:
        # The limit allows it and the system did not: a control group without a share of real-time.
        remedy = ["# the control group has no share of real-time: see cpu.rt_runtime_us of its cgroup"]
    elif machine.rtkit:
        remedy += [
            "# or, for one running loop, of rtkit (no more than priority 20), TID that of its thread 'palpate-servo':",
            "gdbus call --system -d org.freedesktop.RealtimeKit1 -o /org/freedesktop/RealtimeKit1 "
            "-m org.freedesktop.RealtimeKit1.MakeThreadRealtimeWithPID PID TID 20",
        ]
    finding = "no real-time priority (SCHED_FIFO): other programs run before the loop"
    yield Advice("realtime-priority", finding, tuple(remedy))


def _processor_time(machine: Machine, taken: tuple[float, float] | None) -> Iterator[Advice]:
    if machine.cpu_quota is not None:
        yield Advice(
            "cpu-quota",
            f"the control group may take the time of {machine.cpu_quota:g} processors, and is stopped beyond it",
            ("# start it without a quota (docker: no --cpus; systemd: CPUQuota=; Kubernetes: no CPU limit)",),
        )
    if machine.rt_share is not None and machine.rt_share < 0.5:
        yield Advice(
            "realtime-share",
            f"real-time threads may take {100 * machine.rt_share:.0f} % of the time",
            ("sudo sysctl kernel.sched_rt_runtime_us=950000",),
        )
    if machine.allowed_cpus is not None and len(machine.allowed_cpus) == 1:
        yield Advice(
            "processors",
            f"the loop shares CPU {machine.allowed_cpus[0]} with everything else of this program",
            ("# give it two or more: taskset -c 0,1 palpate ..., or more CPUs for the machine",),
        )
    if taken is not None and taken[0] > BUSY:
        yield Advice(
            "load",
            f"programs kept {100 * taken[0]:.0f} % of the processors' time busy while the loop ran",
            ("# end unneeded programs (top lists them), or give the rest fewer processors: taskset, cpuset",),
        )


def _memory(machine: Machine, locked: bool | None) -> Iterator[Advice]:
    limit = machine.memlock_limit
    enough = machine.ipc_lock or limit is None or limit == UNLIMITED or limit >= ENOUGH_MEMORY
    if locked or (locked is None and enough):
        return
    allowed = "" if limit is None or limit == UNLIMITED else f" (limit {limit / 2**20:.0f} MiB)"
    user = machine.user or "<user>"
    yield Advice(
        "locked-memory",
        f"memory is not locked{allowed}: a page that was swapped out stops the loop",
        (f"echo '{user} - memlock unlimited' | sudo tee -a /etc/security/limits.d/90-palpate.conf", "# log in again"),
    )


def _governor(machine: Machine) -> Iterator[Advice]:
    slow = [governor for governor in machine.governors or () if governor != "performance"]
    if slow:
        yield Advice(
            "governor",
            f"processors are governed by '{', '.join(slow)}': one that was idle begins slowly",
            (
                "sudo cpupower frequency-set -g performance",
                "# or: echo performance | sudo tee /sys/devices/system/cpu/cpufreq/policy*/scaling_governor",
            ),
        )


def _guest(machine: Machine, taken: tuple[float, float] | None) -> Iterator[Advice]:
    if machine.hypervisor:
        stolen = "" if taken is None else f", for {100 * taken[1]:.1f} % of the time while the loop ran"
        yield Advice(
            "virtual-machine",
            f"a virtual machine (hypervisor: {machine.hypervisor}): its host stops it whenever it likes{stolen}",
            ("# run the loop on the host, or give the machine processors of its own there (virsh vcpupin)",),
        )


def _kernel(machine: Machine) -> Iterator[Advice]:
    if machine.high_resolution_timers is False:
        rate = machine.timer_hz or 100
        yield Advice(
            "timers", f"timers are as coarse as the tick of {rate} Hz", ("# a kernel with CONFIG_HIGH_RES_TIMERS=y",)
        )
    if machine.preemption not in (None, "PREEMPT_RT"):
        more = ("# at the boot: preempt=full",) if machine.preemption == "PREEMPT_DYNAMIC" else ()
        yield Advice(
            "preempt-rt",
            f"the kernel ({machine.preemption}) is not PREEMPT_RT: a driver may hold a processor for a millisecond",
            ("sudo apt install linux-image-rt-amd64  # Debian; Ubuntu: sudo pro enable realtime-kernel", *more),
        )


def _isolation(machine: Machine) -> Iterator[Advice]:
    cpus = machine.cpus or 1
    if machine.isolated_cpus is None or cpus < 4:
        return  # one of two or three is needed for the rest
    if not machine.isolated_cpus:
        last = cpus - 1
        yield Advice(
            "isolated-cpu",
            "no CPU is kept free of other programs",
            (
                f"# at the boot: isolcpus={last} nohz_full={last} rcu_nocbs={last}",
                f"# then in the scene: [device] cpus = [{last}], or: palpate run scene.toml --cpus {last}",
            ),
        )
    elif not set(machine.isolated_cpus) & set(machine.allowed_cpus or ()):
        free = cpu_ranges(machine.isolated_cpus)
        yield Advice(
            "isolated-cpu",
            f"CPU {free} is kept free, and this process may not use it",
            (f"taskset -c {cpu_ranges({*machine.isolated_cpus, *(machine.allowed_cpus or ())})} palpate ...",),
        )


def _hardware(machine: Machine) -> Iterator[Advice]:
    if machine.smt:
        yield Advice(
            "smt",
            "two threads share a core (SMT): the neighbour slows a tick down",
            ("echo off | sudo tee /sys/devices/system/cpu/smt/control",),
        )
    source = machine.clock_source
    if source is not None and source not in FAST_CLOCKS:
        better = [name for name in machine.clock_sources or () if name in FAST_CLOCKS]
        remedy = f"echo {better[0]} | sudo tee /sys/devices/system/clocksource/clocksource0/current_clocksource"
        yield Advice(
            "clock",
            f"the clock '{source}' takes microseconds to read",
            (remedy if better else "# no faster one is available; the kernel's log shows why",),
        )
