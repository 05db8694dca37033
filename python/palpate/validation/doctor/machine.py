"""Properties of a machine that matter to a loop at 1 kHz, read from the files of the Linux kernel.

Sources: proc(5), cgroups(7), capabilities(7), Documentation/ABI/testing/sysfs-devices-system-cpu of the kernel. What a
system does not tell is None: on others than Linux that is most of it.
"""

from __future__ import annotations

import getpass
import gzip
import os
import platform
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

# Bits of the set of effective capabilities.
CAP_IPC_LOCK, CAP_SYS_NICE = 14, 23
UNLIMITED = -1
# Files by which runtimes of containers give themselves away.
CONTAINER_FILES = {"/.dockerenv": "docker", "/run/.containerenv": "podman", "/run/systemd/container": "container"}
CONTAINER_NAMES = ("docker", "kubepods", "containerd", "lxc", "podman")
CPU = "/sys/devices/system/cpu"
CLOCK = "/sys/devices/system/clocksource/clocksource0"


@dataclass(frozen=True)
class Machine:
    """A machine, as seen by this process."""

    # Names.
    system: str
    kernel: str
    processor: str | None = None
    user: str | None = None
    # Processors that are on, and those that this process may run on.
    cpus: int | None = None
    allowed_cpus: tuple[int, ...] | None = None
    cpu_quota: float | None = None  # processors' worth of time that the control group may take; None without a limit
    smt: bool | None = None  # whether processors share cores
    # Kept free of other programs, and of the kernel's timer tick while one program runs.
    isolated_cpus: tuple[int, ...] | None = None
    tickless_cpus: tuple[int, ...] | None = None
    # How each policy of frequency is governed, without repetition; empty where the system does not scale.
    governors: tuple[str, ...] | None = None
    frequency_mhz: tuple[float, float] | None = None  # lowest and highest frequency
    preemption: str | None = None  # ``PREEMPT_RT``, ``PREEMPT_DYNAMIC``, ``PREEMPT`` or ``none``
    # From the kernel's configuration.
    timer_hz: int | None = None
    high_resolution_timers: bool | None = None
    # In use, and available.
    clock_source: str | None = None
    clock_sources: tuple[str, ...] | None = None
    # Largest real-time priority, and locked memory in bytes, that limits allow; -1 is unlimited.
    rtprio_limit: int | None = None
    memlock_limit: int | None = None
    # Whether this process may pass by those limits.
    sys_nice: bool | None = None
    ipc_lock: bool | None = None
    rt_share: float | None = None  # share of the time that real-time threads may take, 1 for all of it
    # Whether the service that grants real-time priority to programs of a desktop is installed, and a bus to ask it.
    rtkit: bool | None = None
    # What it runs in: a name, "" for none, or None.
    hypervisor: str | None = None
    container: str | None = None

    @property
    def realtime_allowed(self) -> bool | None:
        """Whether limits or capabilities let this process take a real-time priority; a control group may refuse."""
        if self.sys_nice is None and self.rtprio_limit is None:
            return None
        return bool(self.sys_nice) or (self.rtprio_limit or 0) != 0


def read_machine(root: Path = Path("/")) -> Machine:
    """Read the files below ``root``, which is another folder in tests."""
    system, kernel, user = platform.system(), platform.release(), _user()
    if system != "Linux" and root == Path("/"):
        return Machine(system, kernel, platform.processor() or None, user, cpus=os.cpu_count())
    files = _Files(root)
    limits, status, cpuinfo = files.text("/proc/self/limits"), files.text("/proc/self/status"), _cpuinfo(files)
    capabilities = _capabilities(status)
    return Machine(
        system=system,
        kernel=kernel,
        processor=cpuinfo.get("model name"),
        user=user,
        cpus=_count(files.text(f"{CPU}/online")),
        allowed_cpus=cpu_list(_field(status, "Cpus_allowed_list")),
        cpu_quota=_cpu_quota(files),
        smt=_flag(files.text(f"{CPU}/smt/active")),
        isolated_cpus=cpu_list(files.text(f"{CPU}/isolated")),
        tickless_cpus=cpu_list(files.text(f"{CPU}/nohz_full")),
        **_frequency(files),
        preemption=_preemption(files),
        **_configuration(files, kernel),
        clock_source=files.line(f"{CLOCK}/current_clocksource"),
        clock_sources=_words(files.line(f"{CLOCK}/available_clocksource")),
        rtprio_limit=_limit(limits, "Max realtime priority"),
        memlock_limit=_limit(limits, "Max locked memory"),
        sys_nice=None if capabilities is None else bool(capabilities >> CAP_SYS_NICE & 1),
        ipc_lock=None if capabilities is None else bool(capabilities >> CAP_IPC_LOCK & 1),
        rt_share=_rt_share(files),
        rtkit=_rtkit(files),
        hypervisor=_hypervisor(files, cpuinfo),
        container=_container(files),
    )


@dataclass(frozen=True)
class ProcessorTime:
    """Time of all processors since the start of the system, in ticks of the kernel's accounts."""

    total: int  # all of it
    idle: int  # nothing to do, or waiting for a disk
    stolen: int  # given to other guests by the host of a virtual machine

    def shares_since(self, before: ProcessorTime) -> tuple[float, float]:
        """Shares of the time since then that programs of this system took, and that the host took away."""
        total = max(1, self.total - before.total)
        idle, stolen = self.idle - before.idle, self.stolen - before.stolen
        return (total - idle - stolen) / total, stolen / total


def processor_time(root: Path = Path("/")) -> ProcessorTime | None:
    """Read /proc/stat: user, nice, system, idle, iowait, irq, softirq, steal (proc(5)); user has that of guests."""
    first = (_Files(root).text("/proc/stat") or "").partition("\n")[0].split()
    if len(first) < 9 or first[0] != "cpu":
        return None
    times = [int(value) for value in first[1:9]]
    return ProcessorTime(sum(times), times[3] + times[4], times[7])


def cpu_list(text: str | None) -> tuple[int, ...] | None:
    """Processors of a list as the kernel writes it: ``0-3,6``."""
    if text is None:
        return None
    cpus: list[int] = []
    for part in filter(None, text.strip().split(",")):
        first, _, last = part.partition("-")
        if not first.strip().isdigit():
            return ()  # "(null)": none
        cpus += range(int(first), int(last or first) + 1)
    return tuple(cpus)


class _Files:
    """Files below a root; None for one that is not there or not to be read."""

    def __init__(self, root: Path):
        self.root = root

    def path(self, name: str) -> Path:
        return self.root / name.lstrip("/")

    def text(self, name: str) -> str | None:
        try:
            return self.path(name).read_text(errors="replace")
        except OSError:
            return None

    def line(self, name: str) -> str | None:
        text = self.text(name)
        return None if text is None else text.strip()

    def has(self, name: str) -> bool:
        return self.path(name).exists()


def _user() -> str | None:
    try:
        return getpass.getuser()
    except (OSError, KeyError):
        return None


def _count(text: str | None) -> int | None:
    cpus = cpu_list(text)
    return len(cpus) if cpus else os.cpu_count()


def _field(text: str | None, name: str) -> str | None:
    """Value of a line ``name: value``."""
    found = re.search(rf"^{re.escape(name)}\s*:\s*(.*)$", text or "", re.MULTILINE)
    return found and found[1].strip()


def _flag(text: str | None) -> bool | None:
    return None if text is None else text.strip() == "1"


def _words(text: str | None) -> tuple[str, ...] | None:
    return None if text is None else tuple(text.split())


def _cpuinfo(files: _Files) -> Mapping[str, str]:
    """Fields of the first processor."""
    first = (files.text("/proc/cpuinfo") or "").split("\n\n")[0]
    pairs = (line.partition(":") for line in first.splitlines())
    return {name.strip(): value.strip() for name, _, value in pairs}


def _limit(limits: str | None, name: str) -> int | None:
    """Soft limit of a line of /proc/self/limits: name, soft, hard, unit."""
    found = re.search(rf"^{re.escape(name)}\s+(\S+)", limits or "", re.MULTILINE)
    if found is None:
        return None
    return UNLIMITED if found[1] == "unlimited" else int(found[1])


def _capabilities(status: str | None) -> int | None:
    held = _field(status, "CapEff")
    return None if held is None else int(held, 16)


def _cpu_quota(files: _Files) -> float | None:
    """Least quota of the control groups that this process is in, of version 2 (cpu.max) or 1 (cpu.cfs_quota_us)."""
    quotas = []
    for line in (files.text("/proc/self/cgroup") or "").splitlines():
        _, controllers, path = line.split(":", 2)
        if controllers and "cpu" not in controllers.split(","):
            continue
        folder = "/sys/fs/cgroup" if not controllers else f"/sys/fs/cgroup/{controllers}"
        for parent in [Path(path), *Path(path).parents]:
            quotas.append(_quota_of(files, f"{folder}/{parent.as_posix().lstrip('/')}"))
    return min((quota for quota in quotas if quota is not None), default=None)


def _quota_of(files: _Files, group: str) -> float | None:
    newer = files.line(f"{group}/cpu.max")
    if newer is not None:
        quota, _, period = newer.partition(" ")
        return None if quota == "max" else int(quota) / int(period or 100_000)
    older, period = files.line(f"{group}/cpu.cfs_quota_us"), files.line(f"{group}/cpu.cfs_period_us")
    return None if older is None or period is None or int(older) <= 0 else int(older) / int(period)


def _frequency(files: _Files) -> dict:
    """Governors and range of the policies of frequency."""
    folder = files.path(f"{CPU}/cpufreq")
    names = sorted(one.name for one in folder.glob("policy*")) if folder.is_dir() else []
    governors = [files.line(f"{CPU}/cpufreq/{name}/scaling_governor") for name in names]
    ends = [[files.line(f"{CPU}/cpufreq/{name}/cpuinfo_{end}_freq") for name in names] for end in ("min", "max")]
    low, high = ([1e-3 * int(value) for value in values if value] for values in ends)
    known = tuple(dict.fromkeys(governor for governor in governors if governor))
    return {"governors": known, "frequency_mhz": (min(low), max(high)) if low and high else None}


def _preemption(files: _Files) -> str | None:
    version = files.text("/proc/version")
    if _flag(files.text("/sys/kernel/realtime")):
        return "PREEMPT_RT"
    if version is None:
        return None
    found = re.search(r"PREEMPT(_RT|_DYNAMIC|_LAZY)?", version)
    return found[0] if found else "none"


def _configuration(files: _Files, kernel: str) -> dict:
    """Rate of the timer tick, and timers finer than it, from the configuration that the kernel was built with."""
    try:
        text = gzip.decompress(files.path("/proc/config.gz").read_bytes()).decode()
    except (OSError, EOFError):
        text = files.text(f"/boot/config-{kernel}")
    if text is None:
        return {"timer_hz": None, "high_resolution_timers": None}
    rate = re.search(r"^CONFIG_HZ=(\d+)", text, re.MULTILINE)
    return {"timer_hz": rate and int(rate[1]), "high_resolution_timers": "CONFIG_HIGH_RES_TIMERS=y" in text}


def _rt_share(files: _Files) -> float | None:
    runtime, period = (files.line(f"/proc/sys/kernel/sched_rt_{name}_us") for name in ("runtime", "period"))
    if runtime is None or period is None:
        return None
    return 1.0 if int(runtime) < 0 else int(runtime) / int(period)


def _rtkit(files: _Files) -> bool:
    service = "usr/share/dbus-1/system-services/org.freedesktop.RealtimeKit1.service"
    return files.has(service) and any(files.has(f"{run}/dbus/system_bus_socket") for run in ("/run", "/var/run"))


def _hypervisor(files: _Files, cpuinfo: Mapping[str, str]) -> str | None:
    """Name of what the machine is a guest of."""
    if not cpuinfo:
        return None
    if "hypervisor" not in cpuinfo.get("flags", "").split() and not files.has("/sys/hypervisor/type"):
        return ""
    names = (files.line("/sys/hypervisor/type"), files.line("/sys/class/dmi/id/product_name"))
    return next(filter(None, names), "unnamed")


def _container(files: _Files) -> str:
    for name, runtime in CONTAINER_FILES.items():
        if files.has(name):
            return runtime
    groups = files.text("/proc/1/cgroup") or ""
    return next((name for name in CONTAINER_NAMES if name in groups), "")
