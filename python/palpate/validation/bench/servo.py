"""Envelope of the force loop: surface nodes, contacts and law against computing and wake-up times.

Spheres press on plates of ever more surface nodes, the same elements under the tools. One, two and four contacts are as
many tools on one body, whose forces are solved together; eight and sixteen are four tools that each touch two and four
bodies standing in one place, the most that a simulation takes.
"""

from __future__ import annotations

import json
import os
import platform
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from palpate.atomic import written_beside
from palpate.body import Body
from palpate.errors import Error
from palpate.green import GreensFunction
from palpate.scene import BuiltBody, BuiltScene, Scene
from palpate.simulation import Simulation
from palpate.validation.bench.loop_ticks import KINDS, Times, by_kind, played, running, script
from palpate.validation.plots import plot_envelope
from palpate.validation.verify.contact.loop import UNLIMITED
from palpate.validation.verify.contact.reference import Block, body_on_table, top_nodes
from palpate.validation.verify.solution import green_of

RADIUS, DEPTH, FRICTION = 0.01, 1e-3, 0.3
# Of the discs of patches, m: about 20 nodes.
CONTACT_RADIUS = 0.012
LAWS = ("local", "patch", "node")
# Cells along the sides of plates of 4-node tetrahedra, 5 mm between nodes: 1082, 3842, 10338 and 19178 surface nodes.
PLATES = ((18, 18, 6), (40, 40, 4), (68, 68, 4), (94, 94, 4))
CELL, TOUCHED = 0.005, 0.035
# Tools and bodies that make so many contacts.
CONTACTS = {1: (1, 1), 2: (2, 1), 4: (4, 1), 8: (4, 2), 16: (4, 4)}
# Where tools press, from the middle of the top, m: clear of each other and of the edge of what may be touched.
MIDDLES = np.array([[-0.012, -0.012], [0.012, 0.012], [0.012, -0.012], [-0.012, 0.012]])


@dataclass(frozen=True)
class Settings:
    """What is measured.

    Attributes
    ----------
    plates
        Cells of plates along their sides.
    contacts, laws
        Numbers of contacts, keys of :data:`CONTACTS`, and contact laws.
    places, plays
        Places of the script, and how often it is played.
    seconds
        How long each loop runs; 0 for none.

    """

    plates: tuple[tuple[int, int, int], ...] = PLATES
    contacts: tuple[int, ...] = tuple(CONTACTS)
    laws: tuple[str, ...] = LAWS
    places: int = 40
    plays: int = 25
    seconds: float = 2.0


# A twentieth of the time.
QUICK = Settings(PLATES[:2], (1, 4, 16), places=20, plays=5, seconds=1.0)


@dataclass(frozen=True)
class Row:
    """One plate, number of contacts and law.

    Attributes
    ----------
    surface_nodes
        Of a body.
    contacts, tools, bodies
        Contacts, as many as tools times bodies.
    law
        Of the contacts.
    touched
        Surface nodes that the contacts weigh, all together, the tools at rest at the first place.
    ticks
        Times of each kind of tick, played offline, and its costliest tick of the script, us.
    compute, wakeup
        Of the running loop, us; None where it did not run.
    missed_computing, missed_waking
        Its deadlines that passed by computing, and by waking up late.

    """

    surface_nodes: int
    contacts: int
    tools: int
    bodies: int
    law: str
    touched: int
    ticks: dict[str, tuple[Times, float]]
    compute: Times | None = None
    wakeup: Times | None = None
    missed_computing: int = 0
    missed_waking: int = 0


@dataclass(frozen=True)
class Results:
    """Rows, and the machine they were measured on."""

    settings: Settings
    rows: list[Row] = field(default_factory=list)


def run(
    settings: Settings = Settings(), keep: Path | None = None, report: Callable[[int, int], None] | None = None
) -> Results:
    """Measure; rows are kept in a file as they come, and those that it has already are not measured again.

    ``report`` is told how many of all rows are done.

    Raises
    ------
    Error
        A file of other settings or another machine.

    """
    results = Results(settings, _kept(keep, settings))
    done = {(row.surface_nodes, row.contacts, row.law) for row in results.rows}
    total, count = len(settings.plates) * len(settings.contacts) * len(settings.laws), 0
    for cells in settings.plates:
        wanted = [(n, law) for n in settings.contacts for law in settings.laws]
        if all((surface_nodes(cells), *which) in done for which in wanted):
            count += len(wanted)
            continue
        body, green = plate(cells)
        for contacts, law in wanted:
            if (len(green.surface_nodes), contacts, law) not in done:
                results.rows.append(measured(body, green, contacts, law, settings))
                _keep(keep, results)
            count += 1
            if report is not None:
                report(count, total)
    return results


def surface_nodes(cells: tuple[int, int, int]) -> int:
    """Nodes on the surface of a plate: those of all less those inside."""
    return int(np.prod(np.array(cells) + 1) - np.prod(np.array(cells) - 1))


def plate(cells: tuple[int, int, int]) -> tuple[Body, GreensFunction]:
    """Plate held from below, and its Green's function where its top may be touched."""
    body = body_on_table(Block(tuple(CELL * count for count in cells)), cells, quadratic=False)
    return body, green_of(body, touch=top_nodes(body, TOUCHED), precision="f32")


def simulation_of(body: Body, green: GreensFunction, contacts: int, law: str) -> Simulation:
    """Loop whose tools make so many contacts when they touch."""
    tools, bodies = CONTACTS[contacts]
    table: dict[str, Any] = {"shape": "sphere", "radius": RADIUS, "contact": law}
    table |= {"friction": FRICTION} if law == "local" else {"contact_radius": CONTACT_RADIUS}
    names = [{"name": f"plate {rank}", "model": "liver"} for rank in range(bodies)]  # a table asks for a source
    scene = Scene(body=names, tool=[table] * tools, device=UNLIMITED, view={"strain_limit": 0.0})
    return Simulation(BuiltScene(scene, tuple(BuiltBody(body, green, name=table["name"]) for table in names)))


def middles(body: Body, contacts: int) -> np.ndarray:
    """Centres of the spheres when they are pressed, (tools, 3) m."""
    low, high = body.mesh.bounds
    chosen = MIDDLES[: CONTACTS[contacts][0]]
    height = np.full((len(chosen), 1), high[2] + RADIUS - DEPTH)
    return np.hstack([(low + high)[:2] / 2 + chosen, height])


def touched(simulation: Simulation, places: np.ndarray) -> list[int]:
    """Surface nodes under each contact of tools at rest at places (tools, 3), m, in the running loop."""
    with simulation:
        for tool, place in enumerate(places):
            simulation.move(place, tool=tool)
        for _ in range(200):
            time.sleep(0.01)
            found = simulation.contacts()
            if len(found) == len(places) * len(simulation.bodies):
                break
    return [len(contact.nodes) for contact in found]


def measured(body: Body, green: GreensFunction, contacts: int, law: str, settings: Settings) -> Row:
    """Measure one row.

    Raises
    ------
    Error
        Fewer contacts than tools times bodies.

    """
    simulation, pressed = simulation_of(body, green, contacts, law), middles(body, contacts)
    under = touched(simulation, pressed)
    if len(under) != contacts:
        raise Error(f"{contacts} contacts under the law '{law}' were asked for, the loop made {len(under)}")
    path, kinds = script(pressed, settings.places)
    ticks = by_kind(played(simulation, path, settings.plays), kinds)
    row = Row(len(green.surface_nodes), contacts, *CONTACTS[contacts], law, sum(under), ticks)
    if settings.seconds == 0:
        return row
    loop = running(simulation, path, settings.seconds)
    times = {"compute": Times.of(loop.compute_us), "wakeup": Times.of(loop.wakeup_us)}
    return replace(row, **times, missed_computing=loop.missed_computing, missed_waking=loop.missed_waking)


def as_json(results: Results) -> dict[str, Any]:
    """Everything as plain data; times in us."""
    rows = []
    for row in results.rows:
        ticks = {kind: {**asdict(times), "costliest": most} for kind, (times, most) in row.ticks.items()}
        rows.append({**asdict(replace(row, ticks={})), "ticks": ticks})
    return {"machine": machine(), "settings": json.loads(json.dumps(asdict(results.settings))), "rows": rows}


def machine() -> dict[str, Any]:
    """Tell what the figures belong to."""
    return {"processor": _processor(), "cpus": len(os.sched_getaffinity(0)), "kernel": platform.release()}


def plot(results: Results, path: Path) -> None:
    """Draw what each kind of tick takes, what the size of the body adds, and what the running loop shows."""
    rows = results.rows
    largest = max(row.surface_nodes for row in rows)
    laws = [law for law in LAWS if any(row.law == law for row in rows)]
    plot_envelope(laws, KINDS, [as_plotted(row) for row in rows], largest, path)


def as_plotted(row: Row) -> dict[str, Any]:
    """Row as the plot takes it."""
    return {
        "law": row.law,
        "nodes": row.surface_nodes,
        "contacts": row.contacts,
        "kinds": {kind: (times.median, times.p999, most) for kind, (times, most) in row.ticks.items()},
        "compute": row.compute and (row.compute.median, row.compute.p999, row.compute.worst),
        "wakeup": row.wakeup and (row.wakeup.median, row.wakeup.p999, row.wakeup.worst),
    }


def _processor() -> str:
    """Name of the processor as the kernel has it."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(named, platform.processor() or platform.machine())


def _keep(path: Path | None, results: Results) -> None:
    if path is not None:
        with written_beside(path) as partial:
            partial.write_text(json.dumps(as_json(results), indent=1))


def _kept(path: Path | None, settings: Settings) -> list[Row]:
    """Rows of an earlier run of the same settings on the same machine; none without a file."""
    if path is None or not path.exists():
        return []
    try:
        held = json.loads(path.read_text())
        same = (held["machine"], held["settings"]) == (machine(), json.loads(json.dumps(asdict(settings))))
        rows = [_row(one) for one in held["rows"]] if same else []
    except (ValueError, KeyError, TypeError):
        raise Error(f"{path}: is not a file of this benchmark; delete it, or choose another --out") from None
    if not same:
        raise Error(f"{path}: holds rows of other settings or of another machine; delete it, or choose another --out")
    return rows


def _row(held: dict[str, Any]) -> Row:
    def times(one: dict[str, Any] | None) -> Times | None:
        return one and Times(**{key: value for key, value in one.items() if key != "costliest"})

    ticks = {kind: (times(one), one["costliest"]) for kind, one in held["ticks"].items()}
    return Row(**{**held, "ticks": ticks, "compute": times(held["compute"]), "wakeup": times(held["wakeup"])})
