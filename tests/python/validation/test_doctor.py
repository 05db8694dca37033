"""Doctor reads what machines tell of themselves, advises what helps them most first, and reports with stable keys."""

from __future__ import annotations

import gzip
import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
from command_line import refused, run

from benches.viewer import servo_threads
from palpate import DeviceLimits
from palpate.devices import FoundDevice, Listing, Obstacle
from palpate.validation.doctor import report as doctor
from palpate.validation.doctor.machine import cpu_list
from palpate.validation.ticks import LoopTimes, Times

CPU, CLOCK = "sys/devices/system/cpu", "sys/devices/system/clocksource/clocksource0"
# A desktop as its owner finds it: no limits set, a dynamic governor, two threads a core.
DESKTOP = {
    "proc/self/limits": "Limit                     Soft Limit           Hard Limit           Units     \n"
    "Max locked memory         8388608              8388608              bytes     \n"
    "Max realtime priority     0                    0                    \n",
    "proc/self/status": "Name:\tpython\nCapEff:\t0000000000000000\nCpus_allowed:\tff\nCpus_allowed_list:\t0-7\n",
    "proc/self/cgroup": "0::/user.slice/session-2.scope\n",
    "proc/1/cgroup": "0::/init.scope\n",
    "proc/cpuinfo": "processor\t: 0\nmodel name\t: Some CPU @ 3 GHz\nflags\t\t: fpu sse\n\nprocessor\t: 1\n",
    "proc/version": "Linux version 6.1.0-18-amd64 (gcc-12) #1 SMP PREEMPT_DYNAMIC Debian 6.1.76-1\n",
    "proc/sys/kernel/sched_rt_runtime_us": "950000\n",
    "proc/sys/kernel/sched_rt_period_us": "1000000\n",
    f"{CPU}/online": "0-7\n",
    f"{CPU}/isolated": "\n",
    f"{CPU}/nohz_full": " (null)\n",
    f"{CPU}/smt/active": "1\n",
    **{f"{CPU}/cpufreq/policy{k}/scaling_governor": "powersave\n" for k in range(8)},
    **{f"{CPU}/cpufreq/policy{k}/cpuinfo_min_freq": "800000\n" for k in range(8)},
    **{f"{CPU}/cpufreq/policy{k}/cpuinfo_max_freq": "4800000\n" for k in range(8)},
    f"{CLOCK}/current_clocksource": "hpet\n",
    f"{CLOCK}/available_clocksource": "tsc hpet acpi_pm \n",
    "usr/share/dbus-1/system-services/org.freedesktop.RealtimeKit1.service": "[D-BUS Service]\n",
    "run/dbus/system_bus_socket": "",
}
# The same, set up: a real-time kernel, limits for its user, the last CPU kept free.
TUNED = DESKTOP | {
    "proc/self/limits": "Max locked memory         unlimited            unlimited            bytes     \n"
    "Max realtime priority     95                   95                   \n",
    "proc/version": "Linux version 6.1.0-18-rt-amd64 (gcc-12) #1 SMP PREEMPT_RT Debian 6.1.76-1\n",
    "sys/kernel/realtime": "1\n",
    f"{CPU}/isolated": "7\n",
    f"{CPU}/nohz_full": "7\n",
    f"{CPU}/smt/active": "0\n",
    **{f"{CPU}/cpufreq/policy{k}/scaling_governor": "performance\n" for k in range(8)},
    f"{CLOCK}/current_clocksource": "tsc\n",
}
# A container in a virtual machine, with one and a half processors' time.
GUEST = DESKTOP | {
    "proc/self/cgroup": "0::/docker/abc\n",
    "sys/fs/cgroup/docker/cpu.max": "max 100000\n",
    "sys/fs/cgroup/docker/abc/cpu.max": "150000 100000\n",
    "proc/cpuinfo": "processor\t: 0\nmodel name\t: Some CPU\nflags\t\t: fpu sse hypervisor\n",
    "sys/class/dmi/id/product_name": "KVM\n",
    ".dockerenv": "",
}


def machine(folder, files) -> doctor.Machine:
    for name, text in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return doctor.read_machine(folder)


def keys(found) -> list[str]:
    return [one.key for one in found]


def test_a_desktop_is_read(tmp_path):
    (tmp_path / "proc").mkdir()
    (tmp_path / "proc/config.gz").write_bytes(
        gzip.compress(b"CONFIG_HZ_250=y\nCONFIG_HZ=250\nCONFIG_HIGH_RES_TIMERS=y\n")
    )
    found = machine(tmp_path, DESKTOP)
    assert found.processor == "Some CPU @ 3 GHz"
    assert (found.cpus, found.allowed_cpus) == (8, tuple(range(8)))
    assert (found.rtprio_limit, found.memlock_limit, found.sys_nice, found.ipc_lock) == (0, 8 * 2**20, False, False)
    assert found.realtime_allowed is False
    assert (found.preemption, found.timer_hz, found.high_resolution_timers) == ("PREEMPT_DYNAMIC", 250, True)
    assert (found.governors, found.frequency_mhz) == (("powersave",), (800.0, 4800.0))
    assert (found.isolated_cpus, found.tickless_cpus, found.smt) == ((), (), True)
    assert (found.clock_source, found.clock_sources) == ("hpet", ("tsc", "hpet", "acpi_pm"))
    assert (found.rtkit, found.hypervisor, found.container, found.cpu_quota) == (True, "", "", None)
    assert found.rt_share == pytest.approx(0.95)


def test_a_desktop_is_advised_in_order_of_importance(tmp_path):
    found = doctor.advice(machine(tmp_path, DESKTOP), priority=False, locked_memory=False)
    assert keys(found) == [
        *("realtime-priority", "locked-memory", "governor", "preempt-rt"),
        *("isolated-cpu", "smt", "clock"),
    ]
    text = {one.key: "\n".join(one.remedy) for one in found}
    assert "- rtprio 95' | sudo tee /etc/security/limits.d/" in text["realtime-priority"]
    assert "RealtimeKit1.MakeThreadRealtimeWithPID" in text["realtime-priority"]
    assert "- memlock unlimited" in text["locked-memory"]
    assert "cpupower frequency-set -g performance" in text["governor"]
    assert "isolcpus=7" in text["isolated-cpu"]
    assert "cpus = [7]" in text["isolated-cpu"]
    assert "echo tsc" in text["clock"]


def test_nothing_is_advised_where_all_is_well(tmp_path):
    found = machine(tmp_path, TUNED)
    assert found.realtime_allowed
    assert (found.preemption, found.isolated_cpus, found.tickless_cpus) == ("PREEMPT_RT", (7,), (7,))
    assert doctor.advice(found, priority=True, locked_memory=True) == []
    # Limits allow it, yet the loop got none: the control group is what is left to look at.
    (refusal,) = doctor.advice(found, priority=False, locked_memory=True)
    assert "cpu.rt_runtime_us" in refusal.remedy[0]


def test_a_container_is_known_by_its_quota(tmp_path):
    found = machine(tmp_path, GUEST)
    assert (found.hypervisor, found.container, found.cpu_quota) == ("KVM", "docker", 1.5)
    advised = doctor.advice(found, priority=False, locked_memory=True)
    assert keys(advised)[:3] == ["realtime-priority", "cpu-quota", "governor"]
    assert "--cap-add=SYS_NICE" in advised[0].remedy[0]


def test_quotas_of_the_older_control_groups_count(tmp_path):
    files = {
        "proc/self/cgroup": "4:memory:/box\n3:cpu,cpuacct:/box/inner\n",
        "sys/fs/cgroup/cpu,cpuacct/box/cpu.cfs_quota_us": "50000\n",
        "sys/fs/cgroup/cpu,cpuacct/box/cpu.cfs_period_us": "100000\n",
        "sys/fs/cgroup/cpu,cpuacct/box/inner/cpu.cfs_quota_us": "-1\n",
        "sys/fs/cgroup/cpu,cpuacct/box/inner/cpu.cfs_period_us": "100000\n",
    }
    assert machine(tmp_path, files).cpu_quota == 0.5


def test_capabilities_pass_limits_by(tmp_path):
    # Bit 14 is CAP_IPC_LOCK, bit 23 CAP_SYS_NICE (capability.h of Linux).
    for bits, nice, lock in ((1 << 23, True, False), (1 << 14, False, True), ((1 << 23) - 1, False, True)):
        found = machine(tmp_path, DESKTOP | {"proc/self/status": f"CapEff:\t{bits:016x}\n"})
        assert (found.sys_nice, found.ipc_lock, found.realtime_allowed) == (nice, lock, nice)


def test_a_machine_that_tells_nothing_is_told_as_such(tmp_path):
    found = machine(tmp_path, {})
    assert (found.governors, found.isolated_cpus, found.rtprio_limit, found.preemption) == ((), None, None, None)
    assert doctor.advice(found, priority=True, locked_memory=True) == []
    assert "not available" in doctor.as_text(report(found))


def test_the_time_that_others_took_is_read(tmp_path):
    def at(text):
        (tmp_path / "proc").mkdir(exist_ok=True)
        (tmp_path / "proc/stat").write_text(text)
        return doctor.processor_time(tmp_path)

    # user nice system idle iowait irq softirq steal guest guest_nice: of 100 ticks 30 are idle, 20 stolen.
    before, after = at("cpu  100 0 50 800 10 0 5 35 40 0\ncpu0 1 2\n"), at("cpu  130 5 60 825 15 2 8 55 60 0\n")
    assert after.shares_since(before) == (0.5, 0.2)
    assert at("intr 1\n") is None
    guest = doctor.Machine("Linux", "6.1", hypervisor="KVM")
    assert keys(doctor.advice(guest, True, True, (0.9, 0.2))) == ["load", "virtual-machine"]
    assert "20.0 %" in doctor.advice(guest, True, True, (0.1, 0.2))[0].finding


@pytest.mark.parametrize(("text", "cpus"), [("0-3,6\n", (0, 1, 2, 3, 6)), ("\n", ()), ("(null)\n", ()), (None, None)])
def test_lists_of_processors(text, cpus):
    assert cpu_list(text) == cpus


def report(found: doctor.Machine, late_us=(), missed=0, tick_us=20.0) -> doctor.Report:
    delays = np.concatenate([np.full(1000 - len(late_us), 30.0), late_us])
    loop = LoopTimes(np.full(1000, 12.0), delays, 0, missed, True, True)
    return doctor.Report(
        found, 1.0, loop, {"held": Times(1000, tick_us, tick_us, tick_us)}, doctor.PageRate(None, 60.0), []
    )


@pytest.mark.parametrize(
    ("given", "verdict"),
    [
        ({}, "fit"),
        ({"late_us": [2500.0], "missed": 2}, "fit with misses"),
        ({"missed": 20}, "not fit"),
        ({"late_us": [150_000.0], "missed": 1}, "not fit"),
        ({"tick_us": 1200.0}, "not fit"),
    ],
)
def test_the_verdict(given, verdict):
    found = report(doctor.Machine("Linux", "6.1"), **given)
    assert found.verdict == verdict
    last = doctor.as_text(found).splitlines()[-1]
    assert last.startswith(f"1 kHz: {verdict}")
    assert (
        (f"{given['missed']} of {1000 + given['missed']} deadlines" in last)
        if "missed" in given
        else last.endswith("t")
    )


def test_the_histogram_counts_every_tick():
    delays = np.array([0.2, 1.0, 3.0, 3.9, 4.0, 31.9, 32.0])
    counted = doctor.histogram(delays)
    assert [(low, high) for low, high, _ in counted] == [(2.0**k, 2.0 ** (k + 1)) for k in range(6)]
    assert [count for *_, count in counted] == [2, 2, 1, 0, 1, 1]


def test_json_has_the_same_keys_on_every_machine(tmp_path):
    known = doctor.as_json(report(machine(tmp_path, DESKTOP)))
    unknown = doctor.as_json(report(doctor.Machine("Darwin", "23.0")))
    assert known.keys() == unknown.keys()
    assert list(known) == ["schema", "verdict", "machine", "loop", "ticks", "page", "devices", "advice"]
    for part in ("machine", "loop", "page"):
        assert known[part].keys() == unknown[part].keys()
    assert known["loop"]["wakeup"] == {"count": 1000, "median": 30.0, "p999": 30.0, "worst": 30.0}
    assert json.loads(json.dumps(known)) == json.loads(json.dumps(known, allow_nan=False))


def test_haptic_devices_are_counted_in_a_line():
    ready = FoundDevice("0", "omega.3", DeviceLimits(), None, {})
    busy = replace(ready, id="1", obstacle=Obstacle("in use", "close it"))
    listings = (Listing("forcedimension", (ready, busy), None, {}), Listing("touch", (), Obstacle("no", "do"), {}))
    found = replace(report(doctor.Machine("Linux", "6.1")), devices=listings)
    assert "haptic devices ready: forcedimension 1, touch none ('palpate devices' shows why)" in doctor.as_text(found)
    assert doctor.as_json(found)["devices"]["forcedimension"] == {"found": 2, "ready": 1}


def test_this_machine_is_examined(monkeypatch, tmp_path):
    monkeypatch.setattr(doctor, "page_rate", lambda: doctor.PageRate(None, None))
    passed: list[float] = []
    found = doctor.examine(1.0, passed.append)
    # At 1 kHz every deadline is a tick or a missed one; the ends of the window lie within a call of Python.
    deadlines = len(found.loop.wakeup_us) + found.loop.missed_waking + found.loop.missed_computing
    assert 900 <= deadlines <= 2000
    assert passed[-1] == pytest.approx(1.0)
    assert set(found.ticks) == {"begin", "held", "sliding", "abrupt", "release"}
    assert sum(one["count"] for one in doctor.as_json(found)["loop"]["wakeup_histogram"]) == len(found.loop.wakeup_us)
    assert servo_threads() in {None, 0}
    assert doctor.as_text(found).splitlines()[-1].startswith("1 kHz: ")


@pytest.mark.slow
@pytest.mark.browser(own=True)
@pytest.mark.skipif(shutil.which("chromium") is None, reason="no Chromium (Debian: apt install chromium)")
def test_the_page_is_served_and_drawn(monkeypatch):
    from palpate.validation.doctor import measure

    monkeypatch.setattr(measure, "PAGE_SECONDS", 0.5)
    rate = doctor.page_rate()
    assert rate.served_per_second > 1
    assert 0 < rate.drawn_per_second < 200


def test_a_plot_that_has_no_place_is_refused_before_anything_is_measured(tmp_path):
    refused(run("doctor", "--plot", "none/here.png", cwd=tmp_path), "none/here.png", "no folder")
