"""The commands. Heavy imports are inside the functions, so that ``palpate --help`` is quick."""

from __future__ import annotations

import signal
import sys
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from palpate.cli.bodies import (
    Element,
    MaxSize,
    MaxVolumeLoss,
    MesherChoice,
    Part,
    Segments,
    Unit,
    fill_options,
    in_unit,
    is_surface,
)
from palpate.cli.completion import units
from palpate.cli.option_values import read_option, require_unit
from palpate.cli.scene_lines import print_scene
from palpate.cli.store_lines import green_line, precision_line
from palpate.segmentation.endings import is_segmentation
from palpate.startup import restore_interrupts

if TYPE_CHECKING:
    from palpate.mesh import TetMesh

# Exit code of Ctrl-C, as shells have it.
INTERRUPTED = 130

app = typer.Typer(help="Finite elements you can feel.", pretty_exceptions_enable=False, rich_markup_mode=None)


def _show_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(f"palpate {version('palpate')}")
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
    from palpate.errors import Error, MeshWarning, StoreWarning, system_text

    def show(message: Warning | str, category: type[Warning], *_args: object, **_kwargs: object) -> None:
        label = "note" if issubclass(category, (MeshWarning, StoreWarning)) else "warning"
        print(f"palpate: {label}: {message}", file=sys.stderr)

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
    print(f"palpate: error: {message}", file=sys.stderr)
    return 2


@app.command()
def mesh(
    surface: Annotated[
        Path, typer.Argument(help="Surface (STL, OBJ, PLY, OFF, GLB, glTF) or segmentation (NRRD, NIfTI).")
    ],
    out: Annotated[Path, typer.Argument(help="Volume mesh: .vtu, .msh, .vtk, .inp, .mesh, .vol or .node.")],
    unit: Unit = None,
    max_size: MaxSize = None,
    mesher: MesherChoice = None,
    part: Part = None,
    max_volume_loss: MaxVolumeLoss = None,
    segment: Segments = None,
    quadratic: Annotated[
        bool, typer.Option("--quadratic", help="10-node tetrahedra; make them twice as large.")
    ] = False,
) -> None:
    """Fill a surface with tetrahedra. They have 4 nodes, as other programs expect, or 10 with --quadratic.

    A surface that is open, crosses itself or has several parts is wrapped first. The command prints what it did.

    Example: palpate mesh liver.stl liver.vtu --unit mm --max-size 4mm

    Example: palpate mesh scan.ply scan.vtu --unit mm --part all
    """
    from palpate.errors import MeshError
    from palpate.input_file import require_writable
    from palpate.mesh.tetrahedralize import tetrahedralize_with
    from palpate.units import length

    require_writable(out, MeshError)
    size = None if max_size is None else read_option("--max-size", max_size, length)
    element: Element = "quadratic" if quadratic else "linear"
    fill = fill_options(mesher, part, max_volume_loss, segment)
    volume_mesh = in_unit(unit, lambda unit: tetrahedralize_with(element, surface, size, unit, options=fill))
    volume_mesh.write(out)
    print(
        f"{out}: {_mesh_line(volume_mesh)}, smallest dihedral angle {volume_mesh.dihedral_angles().min():.0f} degrees"
    )


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
    import numpy as np

    from palpate.cli.checks import require_store
    from palpate.errors import BodyError
    from palpate.fields import STRAIN_LIMIT
    from palpate.green import GreensFunction, error_text
    from palpate.mesh import size_text
    from palpate.scene.sizes import default_contact_radius
    from palpate.units import length

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


@app.command()
def info(
    file: Annotated[Path, typer.Argument(help="A store, modes, a scene, a volume mesh, a surface or a segmentation.")],
    unit: Annotated[
        str | None,
        typer.Option(
            help="Unit of length; default: m, for a surface the unit that fits its size.", autocompletion=units
        ),
    ] = None,
) -> None:
    """Describe a file.

    Example: palpate info liver.palpate
    """
    from palpate.cli.checks import require_body
    from palpate.dynamics import ModalBasis
    from palpate.green import GreensFunction
    from palpate.green.series import lines_of_series, series_line
    from palpate.mesh import TetMesh

    require_body(file)
    require_unit(unit)
    if file.name.endswith(".modes.palpate"):
        basis = ModalBasis.load(file)
        print(f"{file}: {len(basis)} modes, {basis.frequencies[0]:.4g} to {basis.frequencies[-1]:.4g} Hz")
        _print_origin(basis.description, basis.key)
        return
    if file.name.endswith(".series.palpate"):
        print(f"{file}: {series_line(file)}")
        return
    if file.suffix == ".palpate":
        green = GreensFunction.load(file)
        print(f"{file}: {green_line(green)}")
        print(f"  {precision_line(green)}")
        _print_origin(green.description, green.key)
        for line in lines_of_series(file):
            print(f"  {line}")
        return
    if file.suffix == ".toml":
        print_scene(file)
        return
    if is_segmentation(file):
        from palpate.cli.segmentations import print_segmentation

        print_segmentation(file, unit)
        return
    if is_surface(file):
        from palpate.cli.surfaces import print_surface

        print_surface(file, unit)
        return
    # A size that needs asking about is what this command tells.
    tets = TetMesh.read(file, unit or "m")
    print(f"{file}: {_mesh_line(tets)}")
    low, high = 1e3 * tets.bounds
    print(f"  bounds: {low.round(2).tolist()} to {high.round(2).tolist()} mm, volume {1e6 * tets.volume:.4g} cm3")
    print(
        f"  regions: {sorted(set(tets.regions.tolist()))}, dihedral angle >= {tets.dihedral_angles().min():.1f} degrees"
    )


@app.command("models")
def models_command() -> None:
    """List the built-in models, beside the paper's own counts.

    Example: palpate models
    """
    from palpate.cli.catalogue import print_models

    print_models()


def _mesh_line(mesh: TetMesh) -> str:
    from palpate.mesh import size_text

    return (
        f"{size_text(mesh.bounds[1] - mesh.bounds[0])}, {len(mesh.nodes)} nodes, {len(mesh.tets)} "
        f"{'10-node ' if mesh.is_quadratic else ''}tetrahedra, {len(mesh.surface_nodes)} surface nodes, "
        f"{len(mesh.surface_triangles)} triangles"
    )


def _print_origin(description: dict[str, object], key: str) -> None:
    """Say what a precomputed file was made from."""
    # Constants at every surface node are for programs.
    for name, value in ((name, value) for name, value in description.items() if name != "surface_moduli"):
        print(f"  {name.replace('_', ' ')}: {value}")
    print(f"  key: {key}")
