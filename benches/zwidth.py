"""Largest stiffness that the loop holds on emulated devices, beside theory.

A tool holds on to a block, which makes it a linear spring: its stiffness is set by Young's modulus, and the largest
stable one found by bisection in the same loop that drives real devices.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from dataclasses import asdict, astuple, dataclass, fields
from pathlib import Path

import numpy as np

from benches.emulation import (
    BARE,
    CONTROLLED,
    FIRM,
    LOOSE,
    RAMPED_IN,
    Device,
    Hand,
    Held,
    Mechanics,
    emulate,
    known_devices,
    unlimited_device,
)
from benches.output import Json, Out, Table, make_folder, print_written, show
from benches.sampled_loop import bound_for_any_hand, largest_stable
from palpate.atomic import written_beside
from palpate.figures import empty_figure, write_figure
from palpate.progress import progress_reporter
from palpate.simulation import Simulation
from palpate.validation.verify.benchmark import green_of
from palpate.validation.verify.contact.loop import loop_of
from palpate.validation.verify.contact.reference import Block, body_on_table, top_middle, top_nodes

PERIOD = 1e-3
# Of the map: damping of the device, N s/m, its masses, kg, and delays, s.
DAMPING = 1.0
MASSES = (0.002, 0.005, 0.02, 0.05, 0.2, 1.0)
DELAYS = (0.0, 0.25e-3, 0.5e-3, 1e-3, 2e-3, 3e-3, 5e-3)
# The tip of the map is struck at this speed, known devices as hard as by a tap, for friction holds a light one, m/s.
# It is watched for so many times as its energy takes to fade by damping alone.
KICK, TAP, TIMES = 1e-2, 0.1, 40.0
# Relative width at which bisection ends; a tip this far away, m, has run away.
WIDTH, REACH = 1e-3, 0.5
# Stages under which the map is measured.
STAGES = {"bare": BARE, "controlled": CONTROLLED, "whole": RAMPED_IN}


@dataclass(frozen=True)
class Row:
    """A device of the map, N/m.

    Attributes
    ----------
    mass, delay
        Of the tip, kg, and s.
    any_hand
        ``b / (T/2 + d)``.
    eigenvalue
        Of the sampled system of the mass alone.
    bare, controlled, whole
        Measured: the loop alone, with the passivity controller, and with the whole safety stage, ramped in.

    """

    mass: float
    delay: float
    any_hand: float
    eigenvalue: float
    bare: float
    controlled: float
    whole: float


@dataclass(frozen=True)
class DeviceRow:
    """A known device with assumed mechanics, N/m.

    Attributes
    ----------
    name, recommended
        The device, and the stiffness that its driver recommends.
    any_hand
        ``b / (T/2 + d)`` of its own.
    loose, firm
        From the eigenvalues of tip and hand, friction and encoder apart.
    loose_measured, firm_measured
        With friction and encoder, tapped.

    """

    name: str
    recommended: float
    any_hand: float
    loose: float
    loose_measured: float
    firm: float
    firm_measured: float


class Spring:
    """A tool that holds on in the middle of a block's top, as a spring of any stiffness."""

    def __init__(self) -> None:
        body = body_on_table(Block(), (8, 8, 4), quadratic=False)
        green = green_of(body, touch=top_nodes(body, 0.03))
        self.radius = 0.01
        tool = {"shape": "sphere", "radius": self.radius, "contact": "patch", "contact_radius": 0.015}
        self._loop_on = lambda device: loop_of(body, green, [tool], device)
        self._loop = self._loop_on(None)
        self.place = top_middle(body)
        self.matrix = self._measured()
        values, vectors = np.linalg.eigh(self.matrix)
        self._modulus = self._loop.youngs_modulus
        self.largest, self.direction = float(values[-1]), vectors[:, -1]

    def _measured(self) -> np.ndarray:
        """Stiffness (3, 3), N/m, as the loop has it."""
        step = 1e-4
        path = self.place + step * np.vstack([np.zeros(3), np.eye(3)])
        forces = self._loop.play(path, grabs=np.ones(len(path), dtype=bool)).forces
        matrix = -forces[1:].T / step
        return (matrix + matrix.T) / 2

    def pressed(self, stiffness: float, max_stiffness: float) -> Simulation:
        """Loop whose block pushes back along its normal with a stiffness, under a tool that is limited, N/m."""
        simulation = self._loop_on({"max_stiffness": max_stiffness})
        simulation.set_youngs_modulus(self._modulus * stiffness / self.matrix[2, 2])
        return simulation

    def is_stable(self, device: Device, hand: Hand | None, stage: str, stiffness: float, speed: float = KICK) -> bool:
        """Whether a tip that is struck along the stiffest direction ends with less energy than it began with."""
        scale = stiffness / self.largest
        self._loop.set_youngs_modulus(self._modulus * scale)
        held = Held(unlimited_device(device), self.place, speed * self.direction, hand, grab=True)
        mass, damping = device.mechanics.mass, device.mechanics.damping
        matrix = scale * self.matrix
        if hand is not None:
            mass, damping = mass + hand.mass, damping + hand.damping
            matrix = matrix + hand.stiffness * np.eye(3)
        ticks = max(int(TIMES * mass / damping / PERIOD), 400)
        motion = emulate(self._loop, [held], PERIOD, ticks, STAGES[stage], REACH)
        if len(motion) < ticks:
            return False
        away, velocity = motion.positions[:, 0] - self.place, motion.velocities[:, 0]
        energy = mass * (velocity**2).sum(1) + np.einsum("ti,ij,tj->t", away, matrix, away)
        fifth = ticks // 5
        return bool(energy[-fifth:].mean() < energy[:fifth].mean())

    def largest_stable(
        self, device: Device, hand: Hand | None = None, stage: str = "bare", speed: float = KICK
    ) -> float:
        """By bisection, N/m, of a tip that is struck at a speed, m/s."""
        stable = unstable = 0.5 * bound_for_any_hand(device.mechanics.damping, PERIOD, device.mechanics.delay)
        while self.is_stable(device, hand, stage, unstable, speed):
            stable, unstable = unstable, 2 * unstable
        while unstable > (1 + WIDTH) * stable:
            middle = float(np.sqrt(stable * unstable))
            held = self.is_stable(device, hand, stage, middle, speed)
            stable, unstable = (middle, unstable) if held else (stable, middle)
        return stable


def run(report: Callable[[int, int], None] | None = None) -> tuple[list[Row], list[DeviceRow]]:
    """Measure the map, and the known devices; ``report`` is called with how many are done, and of all."""
    spring, devices = Spring(), known_devices().values()
    of_map = [Mechanics(mass, DAMPING, delay=delay) for mass in MASSES for delay in DELAYS]
    rows: list[Row] = []
    of_devices: list[DeviceRow] = []
    for device in (*of_map, *devices):
        if isinstance(device, Device):
            of_devices.append(measure_device(spring, device))
        else:
            rows.append(measure(spring, device))
        if report is not None:
            report(len(rows) + len(of_devices), len(of_map) + len(devices))
    return rows, of_devices


def measure(spring: Spring, mechanics: Mechanics) -> Row:
    """Measure one device of the map."""
    device = Device("emulated", mechanics)
    theory = (bound_for_any_hand(mechanics.damping, PERIOD, mechanics.delay), largest_stable(mechanics, PERIOD))
    found = (spring.largest_stable(device, stage=stage) for stage in STAGES)
    return Row(mechanics.mass, mechanics.delay, *theory, *found)


def measure_device(spring: Spring, device: Device) -> DeviceRow:
    """Measure one known device in both hands."""
    mechanics = device.mechanics
    hands = (LOOSE, FIRM)
    pairs = [(largest_stable(mechanics, PERIOD, h), spring.largest_stable(device, h, speed=TAP)) for h in hands]
    bound = bound_for_any_hand(mechanics.damping, PERIOD, mechanics.delay)
    (loose, loose_measured), (firm, firm_measured) = pairs
    return DeviceRow(device.name, device.max_stiffness, bound, loose, loose_measured, firm, firm_measured)


def write(rows: Sequence[Row] | Sequence[DeviceRow], path: Path) -> None:
    """Write rows as CSV with their names as header."""
    with written_beside(path) as partial, partial.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow([field.name for field in fields(rows[0])])
        writer.writerows(astuple(row) for row in rows)


def plot(rows: Sequence[Row], path: Path) -> None:
    """Draw the largest stable stiffness against delay, a line for each mass, beside theory."""
    from matplotlib import colormaps

    figure = empty_figure(10.0, 4.2)
    left, right = figure.subplots(1, 2)
    masses = sorted({row.mass for row in rows})
    shades = colormaps["viridis"](np.linspace(0.0, 0.9, len(masses)))
    delays = np.linspace(0.0, max(row.delay for row in rows), 200)
    left.plot(1e3 * delays, DAMPING / (PERIOD / 2 + delays), "k--", linewidth=1, label="b / (T/2 + d)")
    for mass, shade in zip(masses, shades, strict=True):
        chosen = sorted((row for row in rows if row.mass == mass), key=lambda row: row.delay)
        delay = [1e3 * row.delay for row in chosen]
        left.plot(delay, [row.eigenvalue for row in chosen], color=shade, linewidth=1)
        left.plot(delay, [row.bare for row in chosen], "o", color=shade, markersize=4, label=f"{1e3 * mass:g} g")
        right.plot(delay, [row.eigenvalue / row.any_hand for row in chosen], color=shade, linewidth=1)
        right.plot(delay, [row.bare / row.any_hand for row in chosen], "o", color=shade, markersize=4)
    left.set_yscale("log")
    left.set_ylabel("largest stable stiffness [N/m]")
    left.legend(frameon=False, fontsize=8, title="measured; lines: eigenvalues", title_fontsize=8)
    right.axhline(1.0, color="k", linestyle="--", linewidth=1)
    right.set_ylabel("over b / (T/2 + d)")
    for axes in (left, right):
        axes.set_xlabel("delay [ms]")
    left.set_title(f"a device of b = {DAMPING:g} N s/m at {1 / PERIOD:g} Hz, no hand", fontsize=9)
    write_figure(figure, path)


def as_tables(rows: Sequence[Row], devices: Sequence[DeviceRow]) -> list[Table]:
    """Map, and known devices."""
    title = f"Largest stable stiffness, N/m, of a tip with {DAMPING:g} N s/m at {1 / PERIOD:g} Hz"
    headings = ["mass g", "delay ms", "b/(T/2+d)", "eigenvalue", "measured", "controller", "whole stage"]
    lines = []
    for row in rows:
        mass, delay, *figures = astuple(row)
        lines.append([f"{1e3 * mass:g}", f"{1e3 * delay:g}", *(f"{figure:.1f}" for figure in figures)])
    of_devices = [[row.name, *(f"{figure:.0f}" for figure in astuple(row)[1:])] for row in devices]
    names = ["device", "recommended", "alone", "loose hand", "measured", "firm hand", "measured"]
    note = "alone, hands: by theory, friction and encoder apart; measured: with them, tapped at 0.1 m/s"
    return [
        Table(title, headings, lines, words=0),
        Table("Known devices with assumed mechanics, N/m", names, of_devices, notes=[note]),
    ]


def zwidth(out: Out = None, as_json: Json = False) -> None:
    """Largest stiffness that the loop holds on emulated devices, by bisection, beside theory.

    A map over delay and mass, and the known devices in a loose and a firm hand. It takes some minutes.

    Example: python -m benches zwidth --out plots
    """
    with progress_reporter("measuring the largest stable stiffness", True) as report:
        rows, devices = run(report)
    show(as_json, rows, *as_tables(rows, devices), devices=[asdict(row) for row in devices])
    if folder := make_folder(out):
        write(rows, folder / "zwidth.csv")
        write(devices, folder / "devices.csv")
        plot(rows, folder / "zwidth.png")
        print_written(folder / "zwidth.csv", folder / "devices.csv", folder / "zwidth.png")
