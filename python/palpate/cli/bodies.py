"""Bodies from files of any kind, for the commands that solve them."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from palpate.body import Body, Loads, Material, parse
from palpate.cli.checks import read_option, require_unit
from palpate.cli.completion import units
from palpate.cluster import connected, dashboard, threads_of_workers
from palpate.errors import BodyError, MeshError, UnclearUnitError, UnitError
from palpate.mesh import TetMesh
from palpate.mesh.files import read_volume
from palpate.mesh.fill_job import Element, FillOptions, Mesher
from palpate.mesh.size import units_of_size
from palpate.mesh.surface_file import SURFACE_ENDINGS
from palpate.mesh.tetrahedralize import read_surface, tetrahedralize_with
from palpate.progress import Reporter
from palpate.segmentation.endings import is_segmentation
from palpate.units import length, pressure

if TYPE_CHECKING:
    from distributed import Client


Unit = Annotated[
    str | None,
    typer.Option(
        help="Unit of length of the file: m, cm, mm, um, in; default: m, asked for if that is unlikely.",
        autocompletion=units,
    ),
]
ElementChoice = Annotated[
    Element | None,
    typer.Option(help="Tetrahedra with 4 or 10 nodes; default: quadratic for a surface, a volume mesh as it is."),
]
Dask = Annotated[
    str | None,
    typer.Option(metavar="ADDRESS", help="Let the workers of a Dask scheduler compute, such as tcp://10.0.0.1:8786."),
]


@dataclass(frozen=True)
class FillingOptions:
    """How a file is filled, as it was typed; None for what was not."""

    max_size: Annotated[
        str | None, typer.Option(help="Longest edge, such as 4mm; default: by size and shape of the body.")
    ] = None
    mesher: Annotated[
        Mesher | None,
        typer.Option(
            help="netgen fills the surface itself, wrap a new surface around it; default: chosen by the surface."
        ),
    ] = None
    part: Annotated[
        str | None,
        typer.Option(metavar="NUMBER|all", help="Part of a surface with several parts: 1 is the largest, 2 the next."),
    ] = None
    max_volume_loss: Annotated[
        str | None,
        typer.Option(metavar="SHARE", help="Largest share of the volume that wrapping may lose; default: 5%."),
    ] = None
    segment: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME[=E]",
            help="Segment of a label map with its Young's modulus, such as tumor=40kPa; repeat for more.",
        ),
    ] = None

    @property
    def size(self) -> float | None:
        """Longest edge, m."""
        return None if self.max_size is None else read_option("--max-size", self.max_size, length)

    @property
    def fill(self) -> FillOptions:
        """Options of filling."""
        given: dict[str, Any] = {"mesher": self.mesher}
        given["segments"] = tuple(table["name"] for table in segment_tables(self.segment))
        if self.part is not None:
            given["part"] = int(self.part) if self.part.isascii() and self.part.isdigit() else self.part
        if self.max_volume_loss is not None:
            given["max_volume_loss"] = self.max_volume_loss
        return FillOptions(**given)


@dataclass(frozen=True)
class BodyOptions:
    """What a body is made of, as it was typed; None for what was not."""

    radius: Annotated[str | None, typer.Option(help="Radius of the tools; default: a sixteenth of the body.")] = None
    fix: Annotated[
        str | None, typer.Option(help="Supported nodes, such as 'z < min + 5mm'; default of a mesh: its lowest part.")
    ] = None
    youngs_modulus: Annotated[str | None, typer.Option("-E", help="Young's modulus; default of a mesh: 10kPa.")] = None
    poissons_ratio: Annotated[float | None, typer.Option("--nu", help="Poisson's ratio; of a mesh: 0.45.")] = None
    unit: Annotated[
        str | None,
        typer.Option(help="Unit of length of a mesh; default: the one that fits its size.", autocompletion=units),
    ] = None
    element: ElementChoice = None


@contextlib.contextmanager
def cluster(address: str | None) -> Iterator[Client | None]:
    """Client of a scheduler, whose workers and page are printed; None where none is named."""
    if address is None:
        yield None
        return
    with connected(address) as client:
        threads, page = threads_of_workers(client), dashboard(client)
        summary = f"{address}: {len(threads)} workers with {sum(threads.values())} threads"
        print(summary + (f", dashboard at {page}" if page else ""))
        yield client


def is_surface(path: Path) -> bool:
    """Whether the ending is that of a surface, which is yet to be filled."""
    return path.suffix.lower() in SURFACE_ENDINGS


def segment_tables(typed: Sequence[str] | None) -> list[dict[str, str]]:
    """Tables ``[[body.segment]]`` of what was typed, such as ``liver`` or ``tumor=40kPa``.

    Raises UnitError for a modulus that is no positive pressure.
    """
    tables = []
    for text in typed or ():
        name, sign, modulus = text.rpartition("=")
        if not sign:
            tables.append({"name": text})
            continue
        if not read_option(f"--segment {text}", modulus, pressure) > 0:
            raise UnitError(f"--segment {text}: a Young's modulus is positive")
        tables.append({"name": name, "youngs_modulus": modulus})
    return tables


def materials_of(
    mesh: TetMesh, material: Material, typed: Sequence[str] | None
) -> Material | dict[int | str, Material]:
    """Material of a body, or of each of its segments, as they were typed."""
    # The mesh has the names of the file, in the order in which segments were typed, where labels may stand.
    tables = segment_tables(typed)
    moduli = [pressure(table.get("youngs_modulus", material.youngs_modulus)) for table in tables]
    names = list(mesh.region_names)[: len(tables)]
    own = {name: replace(material, youngs_modulus=modulus) for name, modulus in zip(names, moduli, strict=True)}
    return own or material


def read_any(
    path: Path,
    unit: str | None,
    element: Element | None,
    filling: FillingOptions,
    progress: bool | Reporter = True,
    drawn: Callable[[np.ndarray, np.ndarray], None] | None = None,
) -> TetMesh:
    """Read a volume mesh, or fill a surface; ``drawn`` takes the boundary of a segmentation before it is filled.

    Raises MeshError for a file that cannot be read or filled, or one of 10-node tetrahedra where 4-node ones are asked
    for.
    """
    if is_surface(path) or is_segmentation(path):
        size, fill = filling.size, filling.fill
        chosen = element or "quadratic"
        return tetrahedralize_with(chosen, path, size, unit, options=fill, progress=progress, drawn=drawn)
    if filling.max_size is not None or filling.fill != FillOptions():
        raise MeshError(
            f"{path} is a volume mesh: --max-size, --mesher, --part, --max-volume-loss and --segment are for files "
            "that are filled"
        )
    mesh = TetMesh.read(path, unit)
    if element == "linear" and mesh.is_quadratic:
        raise MeshError(f"{path} holds 10-node tetrahedra: leave out --element, or give quadratic")
    return mesh.to_quadratic() if element == "quadratic" else mesh


def body_of(
    mesh: TetMesh, material: Material | Mapping[int | str, Material], fix: str, loads: Loads | None = None
) -> Body:
    """Body that is held where a predicate says; BodyError for a predicate that holds nowhere."""
    mask = parse(fix)(mesh.nodes)
    if not mask.any():
        low, high = mesh.bounds.round(4).tolist()
        raise BodyError(f"no node satisfies --fix '{fix}': the body reaches from {low} to {high} m")
    return Body(mesh, material=material, fixed=mask, loads=loads)


def likely_units(path: Path) -> list[str]:
    """Return the units that a file may be in: metres, or those of a size that hands can feel, the most common first."""
    if is_segmentation(path):
        # Whose unit is that of the file, or mm.
        return ["mm"]
    if is_surface(path):
        return units_of_size(read_surface(path).vertices) or ["m"]
    try:
        read_volume(path, None)
    except UnclearUnitError as error:
        return list(error.fitting) or ["m"]
    return ["m"]


def in_unit(unit: str | None, read: Callable[[str | None], TetMesh]) -> TetMesh:
    """Read a file in its unit of length, asking for it on a terminal where it is not clear."""
    require_unit(unit)
    try:
        return read(unit)
    except UnclearUnitError as error:
        if not (sys.stdin.isatty() and sys.stderr.isatty()):
            raise
        question = f"{error}\nUnit of length"
        return read(typer.prompt(question, default=next(iter(error.fitting), "m"), err=True))
