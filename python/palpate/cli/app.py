"""The commands. What ``import palpate`` does not load is imported in the functions: ``palpate --help`` is quick."""

from __future__ import annotations

import contextlib
import signal
import sys
import warnings
from collections.abc import Iterator
from importlib.metadata import version as version_of
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from palpate.cli.bodies import FillingOptions, Unit, in_unit
from palpate.cli.checks import read_option, require_store
from palpate.cli.option_groups import grouped
from palpate.errors import BodyError, Error, MeshError, MeshWarning, StoreWarning, system_text
from palpate.fields import STRAIN_LIMIT
from palpate.green import GreensFunction, error_text
from palpate.input_file import require_writable
from palpate.mesh import TetMesh, size_text
from palpate.mesh.fill_job import Element
from palpate.mesh.tetrahedralize import tetrahedralize_with
from palpate.progress import status_line
from palpate.scene import BuiltScene, Scene
from palpate.scene.sizes import default_contact_radius
from palpate.startup import restore_interrupts
from palpate.units import length

# Exit code of Ctrl-C, as shells have it.
INTERRUPTED = 130

app = typer.Typer(help="Finite elements you can feel.", pretty_exceptions_enable=False, rich_markup_mode=None)


def _show_version(wanted: bool) -> None:
    if wanted:
        print(f"palpate {version_of('palpate')}")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def options(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Finite elements you can feel. Without a command: an empty page, in which a body is set up."""
    if context.invoked_subcommand is None:
        commands = context.command
        assert isinstance(commands, typer.core.TyperGroup)
        run = commands.get_command(context, "run")
        assert run is not None
        context.invoke(run)


def main() -> None:
    """Run the command line."""
    run_commands(app)


def run_commands(commands: typer.Typer) -> None:
    """Run commands; a user's mistake is one line and exit code 2, Ctrl-C is 130, SIGTERM 143."""

    def show(message: Warning | str, category: type[Warning], *_args: object, **_kwargs: object) -> None:
        print_note(message, "note" if issubclass(category, (MeshWarning, StoreWarning)) else "warning")

    warnings.showwarning = show
    try:
        signal.signal(signal.SIGTERM, _terminate)
        restore_interrupts()
        commands(standalone_mode=True)
    except Error as error:
        sys.exit(_print_error(str(error)))
    except OSError as error:
        sys.exit(_print_error(system_text(error)))
    except (KeyboardInterrupt, SystemExit) as ending:
        # Within a command Typer has made exit code 130 of Ctrl-C, without a message.
        if isinstance(ending, SystemExit) and ending.code != INTERRUPTED:
            raise
        print("palpate: interrupted", file=sys.stderr)
        sys.exit(INTERRUPTED)


def _terminate(*_signal: object) -> None:
    """End in order: children are ended and unfinished files are removed. A second signal ends the process at once."""
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    sys.exit(128 + signal.SIGTERM)


def _print_error(message: str) -> int:
    print_note(message, "error")
    return 2


def print_note(message: Warning | str, label: str = "note") -> None:
    """Print a line beside the results of a command."""
    print(f"palpate: {label}: {message}", file=sys.stderr)


def millimetres(place: np.ndarray) -> str:
    """Write a place (3,), m, to a tenth of a millimetre."""
    return f"({', '.join(f'{1e3 * x:.1f}' for x in place)}) mm"


@contextlib.contextmanager
def keeping(what: str, folder: Path) -> Iterator[None]:
    """Name what Ctrl-C leaves in a folder, from where the same command continues."""
    try:
        yield
    except KeyboardInterrupt:
        print(f"palpate: finished {what} are kept in {folder}, and the same command continues", file=sys.stderr)
        raise typer.Exit(INTERRUPTED) from None


def prepared(scene: Scene) -> BuiltScene:
    """Build a scene, with a line on the terminal meanwhile."""
    with status_line(f"preparing {scene.name}"):
        return scene.build()


@app.command()
@grouped
def mesh(
    surface: Annotated[
        Path, typer.Argument(help="Surface (STL, OBJ, PLY, OFF, GLB, glTF) or segmentation (NRRD, NIfTI).")
    ],
    out: Annotated[Path, typer.Argument(help="Volume mesh: .vtu, .msh, .vtk, .inp, .mesh, .vol or .node.")],
    unit: Unit = None,
    *,
    filling: FillingOptions,
    quadratic: Annotated[
        bool, typer.Option("--quadratic", help="10-node tetrahedra; make them twice as large.")
    ] = False,
) -> None:
    """Fill a surface with tetrahedra. They have 4 nodes, as other programs expect, or 10 with --quadratic.

    A surface that is open, crosses itself or has several parts is wrapped first. The command prints what it did.

    Example: palpate mesh liver.stl liver.vtu --unit mm --max-size 4mm

    Example: palpate mesh scan.ply scan.vtu --unit mm --part all
    """
    require_writable(out, MeshError)
    size, fill = filling.size, filling.fill
    element: Element = "quadratic" if quadratic else "linear"
    volume_mesh = in_unit(unit, lambda unit: tetrahedralize_with(element, surface, size, unit, options=fill))
    volume_mesh.write(out)
    print(f"{out}: {mesh_line(volume_mesh)}, smallest dihedral angle {volume_mesh.dihedral_angles().min():.0f} degrees")


@app.command()
def touch(
    store: Annotated[Path, typer.Argument(help="A precomputed store.")],
    point: Annotated[str, typer.Option(help="Contact point, such as 10mm,0,35mm.")],
    press: Annotated[str, typer.Option(help="Displacement, such as 0,0,-3mm; '-' leaves a component free.")],
    radius: Annotated[
        str | None, typer.Option(help="Contact radius, such as 5mm; 0 is a point; default: a sixteenth of the body.")
    ] = None,
) -> None:
    """Press a patch of the surface and print the force. The exit code is 1 if the strain is beyond linear elasticity.

    Example: palpate touch liver.palpate --point 0,4cm,2cm --press=-,-3mm,- --radius 5mm
    """
    require_store(store)
    green = GreensFunction.load(store)
    where = [read_option("--point", v, length) for v in point.split(",")]
    how = [None if v.strip() == "-" else read_option("--press", v, length) for v in press.split(",")]
    reach = default_contact_radius(green) if radius is None else read_option("--radius", radius, length)
    try:
        answer = green.touch(where, how, reach)
    except BodyError as error:
        # Programs may take the closest point, however far.
        raise BodyError(str(error).partition("; on_surface=")[0]) from None
    if answer.distance > 1e-6 * green.extents.max():
        print(f"landed at {np.array2string(answer.point, precision=5)} m, {size_text([answer.distance])} off the point")
    size = np.linalg.norm(answer.displacements, axis=1)
    print(f"force on the body: {np.array2string(answer.force, precision=5)} N, {np.linalg.norm(answer.force):.5g} N")
    print(f"largest displacement: {1e3 * size.max():.4g} mm at node {green.surface_nodes[size.argmax()]}")
    print(f"estimated error: {error_text(answer.error)}")
    if radius is None:
        print(f"contact radius: {1e3 * reach:.3g} mm, by default; --radius changes it")
    if not green.surface_strain.largest(answer.displacements) <= STRAIN_LIMIT:
        raise typer.Exit(1)


def mesh_line(mesh: TetMesh) -> str:
    """Size of a mesh, and its counts."""
    return (
        f"{size_text(mesh.bounds[1] - mesh.bounds[0])}, {len(mesh.nodes)} nodes, {len(mesh.tets)} "
        f"{'10-node ' if mesh.is_quadratic else ''}tetrahedra, {len(mesh.surface_nodes)} surface nodes, "
        f"{len(mesh.surface_triangles)} triangles"
    )
