"""Haptic devices of this machine: what is found, why something is not, and a gentle check of one."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterator
from dataclasses import asdict
from typing import Annotated, Any

import typer

from palpate.cli.app import app
from palpate.cli.completion import devices as device_names
from palpate.devices import (
    DIRECTIONS,
    Checked,
    DeviceLimits,
    Listing,
    SelfCheck,
    UsbDevice,
    Watched,
    listings,
    usb_devices,
)
from palpate.errors import DeviceError

SCHEMA = 1
# How long a device is watched at rest and while it is moved, and how long a force rises, s.
REST, RANGE, RANGE_UNATTENDED, RISE = 2.0, 10.0, 1.0, 1.5
# Time in which a hand brings the tip back after a push, s.
RETURN = 0.5
FORCE = 0.5


@app.command()
def devices(
    kind: Annotated[
        str | None, typer.Argument(help="Only this kind: haply, touch or forcedimension.", autocompletion=device_names)
    ] = None,
    test: Annotated[
        bool, typer.Option("--test", help="Check one: rate, noise, range, buttons, then small forces.")
    ] = False,
    id: Annotated[str | None, typer.Option(help="Which one to check; default: the only one, or the first.")] = None,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask before forces: for scripts.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, with the same keys on every machine.")] = False,
) -> None:
    """List the haptic devices of this machine, and why one is not found.

    With --test it checks one device, and asks before it puts out a force.
    Exit code 0: there is a device, or the check passed; 1:
    there is none, or it did not; 2: it cannot be opened.

    Example: palpate devices

    Example: palpate devices touch --test
    """
    found = listings(None if kind is None else [kind])
    if test:
        passed = _check(_choose_device(found, id), yes, as_json)
        raise typer.Exit(0 if passed else 1)
    plugged = [device for device in usb_devices() if kind in (None, device.kind)]
    if as_json:
        kinds = [_finite(asdict(listing)) for listing in found]
        print(json.dumps({"schema": SCHEMA, "kinds": kinds, "usb": [asdict(device) for device in plugged]}, indent=2))
    else:
        print("\n".join([*_listing_lines(found), *_usb_lines(plugged)]))
    raise typer.Exit(0 if any(listing.ready for listing in found) else 1)


def _choose_device(found: list[Listing], id: str | None) -> tuple[str, str | None]:
    """Kind and identity of the device to be checked; DeviceError if there is none, or why it cannot be opened."""
    if id is not None:
        if len(found) == 1:
            return found[0].kind, id  # its driver reports what is wrong with it
        kinds = [listing.kind for listing in found if any(device.id == id for device in listing.found)]
        if len(kinds) != 1:
            what = f"{' and '.join(kinds)} have a device '{id}': name the kind too" if kinds else f"there is no '{id}'"
            raise DeviceError(f"{what}; 'palpate devices' lists the devices that were found")
        return kinds[0], id
    for listing in found:
        if listing.ready:
            return listing.kind, listing.ready[0].id
    for listing in found:
        for device in listing.found:
            raise DeviceError(f"{listing.kind} {device.id}: {device.obstacle}")
    missing = [f"{listing.kind}: {listing.missing}" for listing in found if listing.missing is not None]
    if len(found) == 1 and missing:
        raise DeviceError(missing[0])
    raise DeviceError("there is no device to check: 'palpate devices' lists where it searched")


def _check(which: tuple[str, str | None], yes: bool, as_json: bool) -> bool:
    """Check a device, asking before forces; whether it passed."""
    if not yes and not is_terminal():
        raise DeviceError("a check asks before any force: run it at a terminal, or give --yes")
    kind, id = which
    with SelfCheck(kind, id) as check:
        _print_line(f"{check.name} ({kind}{f' {id}' if id else ''}), {_limits_text(check.limits)}")
        _pause("put it down, or hold it still", yes)
        rest = check.watch(REST)
        seconds = RANGE_UNATTENDED if yes else RANGE
        _pause(f"then for {seconds:g} s move it through its whole range, and press each of its buttons", yes)
        moved = check.watch(seconds)
        result = Checked(check.name, check.limits, rest, moved)
        if rest.fault is None and moved.fault is None and _confirm_forces(yes):
            result = Checked(check.name, check.limits, rest, moved, tuple(_pushes(check)))
    if as_json:
        report = {"schema": SCHEMA, "kind": kind, "id": id, "passed": result.passed, **asdict(result)}
        report["rest"]["passed"], report["range"]["passed"] = rest.passed, moved.passed
        report["pushes"] = [{**asdict(push), "verdict": push.verdict} for push in result.pushes]
        print(json.dumps(_finite(report), indent=2))
    else:
        print("\n".join(_result_lines(result)))
    return result.passed


def is_terminal() -> bool:
    """Whether somebody is there to be asked."""
    return sys.stdin.isatty()


def _pushes(check: SelfCheck) -> Iterator[Any]:
    """Push in each direction in turn; a fault is the last."""
    force = min(FORCE, check.limits.max_force)
    for direction, (_, words) in DIRECTIONS.items():
        _print_line(f"  {direction}: pushes {words}")
        check.watch(RETURN)
        push = check.push(direction, force, RISE)
        yield push
        if push.fault is not None:
            return


def _confirm_forces(yes: bool) -> bool:
    question = f"the device will push with up to {FORCE:g} N in six directions: hold it loosely"
    if yes:
        _print_line(question)
        return True
    return not _prompt(f"{question}; Enter to go on, q to stop: ").strip().lower().startswith("q")


def _pause(what: str, yes: bool) -> None:
    if not yes:
        _prompt(f"{what}; Enter to go on: ")


def _prompt(question: str) -> str:
    """Ask beside what is printed; an end of the input is a q."""
    print(question, end="", file=sys.stderr, flush=True)
    return sys.stdin.readline() or "q"


def _print_line(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def _listing_lines(found: list[Listing]) -> Iterator[str]:
    for listing in found:
        facts = "; ".join(f"{name} {value}" for name, value in listing.facts.items())
        yield f"{listing.kind}: {len(listing.found) or 'none'} found{f' ({facts})' if facts else ''}"
        for device in listing.found:
            texts = [device.name, _limits_text(device.limits), *(f"{k} {v}" for k, v in device.facts.items())]
            yield f"  {device.id}  {', '.join(text for text in texts if text)}"
            if device.obstacle is not None:
                yield f"      cannot be opened: {device.obstacle.what}"
                yield f"      {device.obstacle.advice}"
        if listing.missing is not None:
            yield f"  {listing.missing.what}"
            yield f"  {listing.missing.advice}"


def _usb_lines(plugged: list[UsbDevice]) -> Iterator[str]:
    for device in plugged:
        where = f" at {device.node}" if device.node else ""
        yield f"usb: {device.name} {device.vendor}:{device.product}{where}"
        if not device.allowed:
            yield f"  you may not open it{'' if device.node else ', for the system has no file for it'}:"
            yield from (f"    {line}" for line in device.remedy)


def _limits_text(limits: DeviceLimits) -> str:
    parts = ((limits.max_force, "N"), (limits.max_torque, "N m"), (limits.max_stiffness, "N/m"))
    texts = [f"{value:.4g} {unit}" for value, unit in parts if math.isfinite(value) and value > 0]
    return f"at most {', '.join(texts)}" if texts else "without limits of its own"


def _result_lines(result: Checked) -> Iterator[str]:
    rest, moved = result.rest, result.range
    yield f"{'readings':14s}{rest.rate:8.0f} a second, longest gap {1e3 * rest.longest_gap:.1f} ms{_verdict(rest)}"
    yield f"{'noise at rest':14s}" + _by_axis(rest.deviation, 1e6, "um")
    yield f"{'range seen':14s}" + _by_axis(
        [high - low for low, high in zip(moved.lowest, moved.highest, strict=True)], 1e3, "mm"
    )
    yield f"{'buttons seen':14s}{', '.join(map(str, moved.buttons)) or 'none':>8s}"
    if not result.pushes:
        yield f"{'forces':14s}not tried"
    for push in result.pushes:
        words = {
            "along": "along it",
            "still": "too little to tell the direction: hold it more loosely",
            "against": "AGAINST it: wrong axes, or a wrong sign",
            "fault": f"FAULT: {push.fault}",
        }[push.verdict]
        away = "; let go, for nobody held it" if push.ran_away else ""
        yield (
            f"{'force ' + push.direction:14s}{push.force:8.2f} N {DIRECTIONS[push.direction][1]:14s} "
            f"moved {1e3 * push.moved:6.1f} mm {words}{away}"
        )
    yield f"check: {'passed' if result.passed else 'FAILED'}"


def _verdict(watched: Watched) -> str:
    if watched.fault is not None:
        return f": FAULT: {watched.fault}"
    if watched.readings == 0:
        return ": NONE"
    return "" if watched.passed else ": TOO FEW for a force loop at 1 kHz"


def _by_axis(values: Any, factor: float, unit: str) -> str:
    return "  ".join(f"{axis} {factor * value:.4g} {unit}" for axis, value in zip("xyz", values, strict=True))


def _finite(value: Any) -> Any:
    """Put null for what is infinite: JSON has no word for it."""
    if isinstance(value, dict):
        return {key: _finite(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
