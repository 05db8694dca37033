"""Computing time of every kind of tick, over laws, tools, contacts, and the sizes of bodies and patches.

A force loop is as good as its costliest tick, so each kind has a row of its own. All rows are measured alike: a path is
played several times by the loop's own tick, with safety stage, hand-off and log, timed by the clock of its thread.
Median, p99.9 and worst are over all plays, after what other programs have left of the caches. The shortest time of a
tick over its plays is its cost without them: "shortest" is the median of these, "mean" their mean over the places that
are pressed, and "costliest" the largest.

The tables, each a list of cases:

- ``patch``: one and two tools with patches of ever more nodes on the built-in liver, curved 10-node tetrahedra, at rest
  and in motion; beside them a plain copy of the entries of ``Psi`` between the nodes of the largest patch.
- ``local``: a sphere that slides over ever larger plates under the local law, beside numpy, and every kind of tick.
- ``envelope``: spheres on ever larger plates, by law and number of contacts, and the running loop. One, two and four
  contacts are as many tools on one body, whose forces are solved together; eight and sixteen are four tools that each
  touch two and four bodies standing in one place, the most that a simulation takes.
- ``size``: one sticking contact, 1000 touchable nodes, on balls of ever more nodes.
- ``c``: a program in C++ beside one in Rust (`tick_from_c.py`).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from benches import tick_from_c
from benches.contact_numpy import contact_us, solve_us
from benches.output import Json, Out, Table, make_folder, print_written, show
from benches.rows_file import RowsFile
from benches.tick_case import Case, Play, Row
from palpate import _native, models
from palpate.body import Body, Material
from palpate.errors import Error
from palpate.green import GreensFunction, precompute
from palpate.mesh import tetrahedralize
from palpate.progress import progress_reporter
from palpate.scene import YOUNGS_MODULUS, BodyMotion, BuiltBody, BuiltScene, Scene
from palpate.simulation import Simulation
from palpate.validation.ticks import (
    DEPTH,
    FRICTION,
    KINDS,
    RADIUS,
    UPRIGHT,
    plate,
    press_centres,
    script,
)
from palpate.validation.verify.contact.loop import UNLIMITED, loop_of, sphere, straight

# Titles, and the figures that are printed.
TABLES = {
    "patch": ("Ticks under a patch on the liver, us", ("mean", "costliest")),
    "local": ("Ticks under the local law, us", ("shortest", "costliest")),
    "envelope": ("Ticks by law and number of contacts, us", ("median", "p999", "worst", "costliest")),
    "size": ("A sticking contact on ever larger balls, us", ("shortest", "costliest")),
    "c": ("A tick called from another program, us", ("median",)),
}
# Cells along the sides of plates, 5 mm between nodes: 1082, 3842, 10338 and 19178 surface nodes.
PLATES = ((18, 18, 6), (40, 40, 4), (68, 68, 4), (94, 94, 4))


@dataclass(frozen=True)
class Settings:
    """What is measured in the envelope.

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
    contacts: tuple[int, ...] = (1, 2, 4, 8, 16)
    laws: tuple[str, ...] = ("local", "patch", "node")
    places: int = 40
    plays: int = 25
    seconds: float = 2.0


# A twentieth of the time.
QUICK = Settings(PLATES[:2], (1, 4, 16), places=20, plays=5, seconds=1.0)


def run(
    tables: Sequence[str],
    settings: Settings = Settings(),
    keep: Path | None = None,
    report: Callable[[int, int], None] | None = None,
) -> list[Row]:
    """Measure; rows are kept in a file as they come, and those that it has already are not measured again.

    ``report`` is called with the number of cases done, and of all.

    Raises
    ------
    Error
        A file of other settings or another machine.

    """
    file = RowsFile(keep, asdict(settings))
    rows = [Row(**row) for row in file.read()]
    cases = [case for table in tables for case in CASES[table](settings)]
    for count, case in enumerate(cases, 1):
        if not any(row.belongs_to(case.table, case.labels) for row in rows):
            rows += case.measure()
            file.write([asdict(row) for row in rows])
        if report is not None:
            report(count, len(cases))
    return rows


# Patch: nodes that it should have in the middle, surface nodes that are tried to find its radius, places that are
# pressed and how often; tool, how high it waits and how deep it presses, m; copies of entries; modes.
SIZES, TRIED, PLACES, TIMES = (10, 30, 100), 60, 40, 6
TOOL_RADIUS, CLEAR, PATCH_DEPTH = 8e-3, 4e-3, 1e-3
GATHERS, LIVER_MODES = 50, 200
MODEL = "liver"


def patch_cases(_settings: Settings) -> Iterator[Case]:
    """Yield one and two tools on the liver."""
    for size in SIZES:
        for body in ("at rest", "moves"):
            for tools in (1, 2):
                labels = {"about nodes": size, "body": body, "tools": tools}
                yield Case("patch", labels, partial(_patch_play, size, body == "moves", tools))


@lru_cache(maxsize=1)
def _liver() -> tuple[Body, GreensFunction]:
    mesh = models.load(MODEL)
    body = Body(mesh, material=Material(YOUNGS_MODULUS[MODEL], 0.45), fixed=models.fixed(MODEL, mesh))
    return body, precompute(body, progress=False)


@lru_cache(maxsize=1)
def _motion(body: Body, modes: int, max_stiffness: float | None = None) -> BodyMotion:
    scene = Scene(body={"model": MODEL}, dynamics={"modes": modes})
    assert scene.dynamics is not None
    return scene.dynamics.build(body, max_stiffness or scene.device.max_stiffness, progress=False)


def _patch_play(size: int, moves: bool, tools: int) -> Play:
    body, green = _liver()
    radius = _radius_for(green, size)
    table = {"radius": TOOL_RADIUS, "contact_radius": radius}
    scene = Scene(body={"model": MODEL}, tool=[table, table], view={"strain_limit": 0.0})
    simulation = Simulation(BuiltScene.of(scene, body, green, _motion(body, LIVER_MODES) if moves else None))
    points, normals = _places(green, PLACES)
    patches = [_patch(green, point, radius) for point in points]
    gather = green._core.gather_us(max(patches, key=len).tolist(), GATHERS)
    out, down = points + (TOOL_RADIUS + CLEAR) * normals, points + (TOOL_RADIUS - PATCH_DEPTH) * normals
    away, others = np.full_like(out, np.nan), np.roll(np.arange(PLACES), 1)
    # Ticks of a press by name: where both tools are. A second one begins and leaves within the press of the first.
    if tools == 1:
        press = [("free", out, away), ("begin", down, away), *2 * [("hold", down, away)], ("end", out, away)]
    else:
        press = [("", out, out[others]), ("", down, out[others]), ("second begins", down, down[others])]
        press += [("two hold", down, down[others]), ("second ends", down, out[others]), ("", out, away)]
    press.append(("", away, away))
    names, first, second = zip(*press, strict=True)
    path = np.stack([np.stack(first, axis=1), np.stack(second, axis=1)], axis=2).reshape(-1, 2, 3)
    beside = {"nodes": int(np.median([len(patch) for patch in patches])), "gather": gather}
    return Play(simulation, path, names * PLACES, TIMES, PLACES, at_once=True, beside=beside)


@lru_cache
def _radius_for(green: GreensFunction, size: int) -> float:
    """Contact radius whose patches have so many nodes in the middle."""
    points = _places(green, TRIED)[0]
    low, high = 0.0, float(np.ptp(green.surface_positions, axis=0).max())
    while high - low > 1e-5:
        middle = 0.5 * (low + high)
        try:
            found = np.median([len(_patch(green, point, middle)) for point in points])
        except Exception:
            found = np.inf  # more than a tick can weigh
        low, high = (middle, high) if found < size else (low, middle)
    return low


def _patch(green: GreensFunction, point: np.ndarray, radius: float) -> np.ndarray:
    return _native.contact_patch(green._core, tuple(point), radius)[0]


def _places(green: GreensFunction, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Centres of free triangles and their outward normals, (count, 3) each."""
    corners = green.surface_positions[np.searchsorted(green.surface_nodes, green.surface_triangles)]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    free = np.flatnonzero(~np.isin(green.surface_triangles, green.fixed_nodes).any(axis=1))
    chosen = np.random.default_rng(1).choice(free, count, replace=False)
    return corners[chosen].mean(axis=1), normals[chosen] / np.linalg.norm(normals[chosen], axis=1)[:, None]


# Local law: ticks of a path, how often it is played, modes of a body in motion, orientation of a tool along y.
TICKS, PLAYS, PLATE_MODES = 4000, 5, 100
LYING = (0.5**0.5, 0.5**0.5, 0.0, 0.0)
UP = np.array([0.0, 0.0, 1.0])
SLIDES = "slides, 11 mm/s"


def local_cases(_settings: Settings) -> Iterator[Case]:
    """Yield a sphere that slides over each plate, and every kind of tick on the first."""
    for cells in PLATES:
        for name in _motions(np.zeros(3)) if cells == PLATES[0] else (SLIDES,):
            labels = {"surface nodes": surface_nodes(cells), "tick": name}
            yield Case("local", labels, partial(local_play, cells, name))


def _slide(middle: np.ndarray) -> np.ndarray:
    """Path (TICKS, 3), m, across the middle."""
    return straight(middle - (0.02, 0.011, 0), middle + (0.02, 0.011, 0), 0.0456 / TICKS)[:TICKS]


def _motions(middle: np.ndarray) -> dict[str, tuple[list[dict], np.ndarray, Sequence[float]]]:
    """Tools, path and orientation of every kind of tick; ``middle`` (3,), m, is the centre of a pressed sphere."""
    ball, slide, turn = sphere(RADIUS, FRICTION), _slide(middle), np.arange(TICKS)[:, None] / TICKS
    along, common = np.array([1.0, 0.0, 0.0]), {"contact": "local", "friction": FRICTION}
    ellipsoid = {"shape": "ellipsoid", "semi_axes": [0.012, 0.009, 0.008], **common}
    capsule = {"shape": "capsule", "radius": 0.006, "length": 0.024, **common}
    punch = {"shape": "punch", "radius": 0.006, "rounding": 0.001, **common}
    taps = np.where(np.arange(TICKS) % 2 == 0, 2 * DEPTH, 0.0)[:, None] * UP
    return {
        "free, 5 mm above": ([ball], slide + 6e-3 * UP, UPRIGHT),
        "holds": ([ball], np.broadcast_to(middle, slide.shape), UPRIGHT),
        "sticks, 20 um to and fro": ([ball], middle + 2e-5 * np.sin(60 * turn) * along, UPRIGHT),
        SLIDES: ([ball], slide, UPRIGHT),
        "slides to and fro, up to 0.4 m/s": ([ball], middle + 0.02 * np.sin(80 * turn) * along, UPRIGHT),
        "comes and leaves in turn": ([ball], slide + taps, UPRIGHT),
        "two spheres slide": ([ball, ball], np.stack([slide, slide + (0.0, 0.022, 0.0)], axis=1), UPRIGHT),
        f"slides on a body in motion, {PLATE_MODES} modes": ([ball], slide, UPRIGHT),
        "ellipsoid slides": ([ellipsoid], slide - 0.002 * UP, UPRIGHT),
        "capsule (cells) slides": ([capsule], slide - 0.004 * UP, LYING),
        "punch (cells) slides": ([punch], slide - 0.01 * UP, UPRIGHT),
    }


def motion_names() -> list[str]:
    """Return every kind of tick under the local law."""
    return list(_motions(np.zeros(3)))


def local_play(cells: tuple[int, int, int], name: str) -> Play:
    """Prepare a kind of tick on a plate."""
    body, green = _plate(cells)
    middle = press_centres(body, [(0.0, 0.0)])[0]
    tools, path, orientation = _motions(middle)[name]
    motion = _motion(body, PLATE_MODES, UNLIMITED["max_stiffness"]) if "in motion" in name else None
    # The tool comes from above in ticks without a name.
    lead = np.stack([path[0] + lift * UP for lift in np.linspace(3e-3, 0, 31)[:-1]])
    simulation = loop_of(body, green, tools, motion=motion)
    moved = np.ascontiguousarray(np.concatenate([lead, path]).reshape(len(lead) + TICKS, -1, 3))
    beside = {}
    if name == SLIDES:
        point = middle - (RADIUS - DEPTH) * UP
        beside = {"numpy: three equations": solve_us(green, point), "numpy: contact": contact_us(green, point, path)}
    kinds = [""] * len(lead) + [name] * TICKS
    return Play(simulation, moved, kinds, PLAYS, orientation=orientation, beside=beside)


@lru_cache(maxsize=1)
def _plate(cells: tuple[int, int, int]) -> tuple[Body, GreensFunction]:
    return plate(cells)


def surface_nodes(cells: tuple[int, int, int]) -> int:
    """Nodes on the surface of a plate: those of all less those inside."""
    return int(np.prod(np.array(cells) + 1) - np.prod(np.array(cells) - 1))


# Envelope: radius of the discs of patches, m (about 20 nodes); tools and bodies that make so many contacts; where tools
# press, from the middle of the top, m: clear of each other and of the edge of what may be touched.
CONTACT_RADIUS = 0.012
CONTACTS = {1: (1, 1), 2: (2, 1), 4: (4, 1), 8: (4, 2), 16: (4, 4)}
SHIFTS = ((-0.012, -0.012), (0.012, 0.012), (0.012, -0.012), (-0.012, 0.012))


def envelope_cases(settings: Settings) -> Iterator[Case]:
    """Yield every law and number of contacts on every plate."""
    for cells in settings.plates:
        for contacts in settings.contacts:
            for law in settings.laws:
                labels = {"law": law, "surface nodes": surface_nodes(cells), "contacts": contacts}
                yield Case("envelope", labels, partial(_envelope_play, cells, contacts, law, settings))


def _envelope_play(cells: tuple[int, int, int], contacts: int, law: str, settings: Settings) -> Play:
    body, green = _plate(cells)
    simulation, centres = envelope_simulation(body, green, contacts, law), envelope_centres(body, contacts)
    under = nodes_under_contacts(simulation, centres)
    if len(under) != contacts:
        raise Error(f"{contacts} contacts under the law '{law}' were asked for, the loop made {len(under)}")
    path, ranks = script(centres, settings.places)
    kinds = [KINDS[rank] if rank >= 0 else "" for rank in ranks]
    beside = {"nodes": sum(under)}
    return Play(simulation, path, kinds, settings.plays, settings.places, beside=beside, seconds=settings.seconds)


def envelope_simulation(body: Body, green: GreensFunction, contacts: int, law: str) -> Simulation:
    """Loop whose tools make so many contacts when they touch."""
    tools, bodies = CONTACTS[contacts]
    table: dict[str, Any] = {"shape": "sphere", "radius": RADIUS, "contact": law}
    table |= {"friction": FRICTION} if law == "local" else {"contact_radius": CONTACT_RADIUS}
    names = [{"name": f"plate {rank}", "model": MODEL} for rank in range(bodies)]  # a table asks for a source
    scene = Scene(body=names, tool=[table] * tools, device=UNLIMITED, view={"strain_limit": 0.0})
    return Simulation(BuiltScene(scene, tuple(BuiltBody(body, green, name=table["name"]) for table in names)))


def envelope_centres(body: Body, contacts: int) -> np.ndarray:
    """Centres of the spheres when they are pressed, (tools, 3) m."""
    return press_centres(body, SHIFTS[: CONTACTS[contacts][0]])


def nodes_under_contacts(simulation: Simulation, places: np.ndarray) -> list[int]:
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


# Size: radius of the balls and longest edges of their elements, m; touchable nodes; ticks and plays.
BALL, ELEMENTS, TOUCHABLE = 0.06, (0.0085, 0.0032), 1000
SIZE_TICKS, SIZE_PLAYS = 20_000, 9


def size_cases(_settings: Settings) -> Iterator[Case]:
    """Yield a coarse ball and a fine one."""
    for element in ELEMENTS:
        yield Case("size", {"elements, mm": 1e3 * element}, partial(_size_play, element))


def _size_play(element: float) -> Play:
    import trimesh

    surface = trimesh.creation.icosphere(subdivisions=5 if element < 4e-3 else 4, radius=BALL)
    mesh = tetrahedralize(surface, element)
    body = Body(mesh, material=Material(10e3, 0.45), fixed=mesh.nodes[:, 2] < -0.8 * BALL)
    touch = np.sort(mesh.surface_nodes[np.argsort(-mesh.nodes[mesh.surface_nodes, 2])[:TOUCHABLE]])
    green = precompute(body, touch=touch, progress=False)
    simulation = Simulation(BuiltScene.of(Scene.of_store(green.path), body, green))
    height = BALL + simulation.scene.tools[0].radius - 0.004 * np.sin(np.linspace(0, np.pi, SIZE_TICKS))
    path = height[:, None, None] * UP
    beside = {"nodes": len(mesh.nodes), "on the surface": len(mesh.surface_nodes)}
    return Play(simulation, path, ["sticks"] * SIZE_TICKS, SIZE_PLAYS, beside=beside)


CASES = {"patch": patch_cases, "local": local_cases, "envelope": envelope_cases, "size": size_cases}


def as_tables(rows: Sequence[Row]) -> list[Table]:
    """Return the tables that have rows, with a rule where the first label changes."""
    found = []
    for name, (title, figures) in TABLES.items():
        chosen = [row for row in rows if row.table == name]
        if not chosen:
            continue
        labels = list(chosen[0].labels)
        beside = list(dict.fromkeys(key for row in chosen for key in row.beside))
        lines: list[list[str] | None] = []
        for before, row in zip([None, *chosen], chosen, strict=False):
            if before is not None and before.labels[labels[0]] != row.labels[labels[0]]:
                lines.append(None)
            lines.append(
                [
                    *(str(row.labels[label]) for label in labels),
                    *(_cell(getattr(row, figure), ".1f") for figure in figures),
                    *(_cell(row.beside.get(key), ".4g") for key in beside),
                ]
            )
        headings = [*labels, *("p99.9" if figure == "p999" else figure for figure in figures), *beside]
        found.append(Table(title, headings, lines, words=len(labels)))
    return found


def _cell(value: float | None, style: str) -> str:
    return "" if value is None else format(value, style)


def tick(
    tables: Annotated[
        list[str] | None, typer.Argument(help=f"Of {', '.join(TABLES)}; 'patch' and 'local' if none is named.")
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="A smaller envelope, half a minute.")] = False,
    out: Out = None,
    prefix: Annotated[Path | None, typer.Option(help="Where libpalpate is installed, for 'c'.")] = None,
    as_json: Json = False,
) -> None:
    """Time every kind of tick: by patch, law, tool, number of contacts and size of the body.

    The envelope takes some ten minutes. With --out rows are kept in tick.json as they come, a run that was interrupted
    goes on from there, and the envelope is drawn into envelope.png. With 'c', exit code 1 if C++ takes more than 1.2
    times as long as Rust.

    Example: python -m benches tick envelope --quick --out envelope
    """
    chosen = tables or ["patch", "local"]
    unknown = [name for name in chosen if name not in TABLES]
    if unknown:
        raise Error(f"no table is called '{unknown[0]}'; there are {', '.join(TABLES)}")
    if "c" in chosen and prefix is None:
        raise Error("the table 'c' needs the library: 'make install PREFIX=DIR', then --prefix DIR")
    folder = make_folder(out)
    with progress_reporter("timing ticks", True) as report:
        keep = None if folder is None else folder / "tick.json"
        rows = run([name for name in chosen if name != "c"], QUICK if quick else Settings(), keep, report)
        if prefix is not None and "c" in chosen:
            rows += tick_from_c.rows(prefix)
    show(as_json, rows, *as_tables(rows))
    if folder is not None and "envelope" in chosen:
        from benches.tick_plot import plot_envelope

        plot_envelope([row for row in rows if row.table == "envelope"], folder / "envelope.png")
        print_written(folder / "tick.json", folder / "envelope.png")
    if any(row.beside.get(tick_from_c.RATIO, 0.0) > tick_from_c.MOST for row in rows):
        raise typer.Exit(1)
