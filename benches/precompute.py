"""All surface columns of a body's compliance, beside the solvers that others would use, in one run.

Every method factorises and computes the displacements of all surface dofs for a unit force on each of them (supported
dofs have none). Palpate's time is that of its whole operator, assembly and columns of supports included. Where columns
would take minutes, a sample of them is timed and scaled; the table says so. Each number of threads has a process of its
own, for libraries fix theirs when they are loaded.

Times are (2,) arrays: seconds on the wall, and seconds of all processors. On a machine that others use too, the second
is the one to compare with one thread.
"""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from benches.output import ROOT, Json, Out, Table, make_folder, show
from palpate import _native, models
from palpate.body import Body, Material, problem_arrays
from palpate.cache import cache_directory
from palpate.errors import BodyError
from palpate.figures import empty_figure, write_figure
from palpate.green import GreensFunction
from palpate.mesh import TetMesh, tetrahedralize
from palpate.progress import status_line

# Longest edge of the liver's elements, m; "1k" is the paper's liver itself, 1404 nodes.
SIZES: dict[str, float | None] = {"1k": None, "2k": 0.0095, "15k": 0.00395, "20k": 0.0034}
# A body with more free dofs than this has a sample of its columns timed by the peers, and no dense inverse.
LARGE = 8000
SAMPLE = 512
# Every method is measured so often; the slow ones three times, and on large bodies once.
TURNS = 5
SLOW = ("SuperLU", "dense inverse (the paper)")
THREAD_VARIABLES = ("RAYON_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")


@dataclass(frozen=True)
class Result:
    """One method on one body: seconds, median of ``repeats``, and how many columns were timed (None: all)."""

    size: str
    nodes: int
    free_dofs: int
    surface_dofs: int
    method: str
    threads: int
    seconds: float
    cpu_seconds: float
    repeats: int
    sampled: int | None = None
    writing_seconds: float | None = None


def run(sizes: Sequence[str], threads: Sequence[int]) -> list[Result]:
    """Measure.

    Raises
    ------
    BodyError
        An unknown size, or a measurement that failed.

    """
    unknown = [size for size in sizes if size not in SIZES]
    if unknown:
        raise BodyError(f"unknown size '{unknown[0]}': there are {', '.join(SIZES)}")
    results: list[Result] = []
    for size in sizes:
        mesh_of(size)
        for count in threads:
            environment = {**os.environ, **{name: str(count) for name in THREAD_VARIABLES}}
            command = [sys.executable, "-m", "benches.precompute", size, str(count)]
            child = subprocess.run(command, capture_output=True, text=True, env=environment, cwd=ROOT)
            if child.returncode:
                lines = child.stderr.strip().splitlines() or [f"exit status {child.returncode}"]
                raise BodyError(f"the measurement of {size} failed: {lines[-1]}")
            results += [Result(**row) for row in json.loads(child.stdout)]
    return results


def mesh_of(size: str) -> TetMesh:
    """Liver of about that many nodes; meshes of NETGEN are kept in the cache."""
    longest = SIZES[size]
    if longest is None:
        return models.liver(paper=True)
    file = cache_directory() / "bench" / f"liver-{size}-{longest}.npz"
    if not file.exists():
        import trimesh

        coarse = models.liver()
        mesh = tetrahedralize(trimesh.Trimesh(coarse.nodes, coarse.surface_triangles, process=False), longest)
        file.parent.mkdir(parents=True, exist_ok=True)
        beside = file.with_suffix(f".{os.getpid()}.npz")
        np.savez(beside, nodes=mesh.nodes, tets=mesh.tets)
        beside.replace(file)
    with np.load(file) as data:
        return TetMesh(data["nodes"], data["tets"])


def measure(size: str, threads: int) -> list[Result]:
    """Measure all methods in this process, which has its number of threads already, in turns."""
    mesh = mesh_of(size)
    body = Body(mesh, material=Material(10e3, 0.45), fixed=models.fixed("liver", mesh))
    system = System(body)
    large = len(system.free) > LARGE
    sample = system.columns[:: max(1, len(system.columns) // SAMPLE)] if large else system.columns
    methods = {name: method for name, method in PEERS.items() if name not in missing_peers()}
    if not large:
        methods["dense inverse (the paper)"] = dense_inverse
    times: dict[str, list[np.ndarray]] = {name: [] for name in ("Palpate", *methods)}
    writing = []
    # In turns, so that other programs disturb all alike; on small bodies a first turn warms up.
    for turn in range(-1 if not large else 0, TURNS):
        computed, written = palpate_columns(body)
        measured = {"Palpate": computed}
        for name, method in methods.items():
            if name not in SLOW or 0 <= turn < (1 if large else 3):
                measured[name] = method(system, sample)
        if turn >= 0:
            writing.append(written)
            for name, value in measured.items():
                times[name].append(value)
    results = []
    for name, values in times.items():
        ours = name == "Palpate"
        wall, cpu = (float(value) for value in np.median(values, axis=0))
        sampled = len(sample) if large and not ours else None
        file = float(np.median(writing, axis=0)[0]) if ours else None
        shape = (size, len(mesh.nodes), len(system.free), len(system.columns))
        results.append(Result(*shape, name, threads, wall, cpu, len(values), sampled, file))
    return results


def now() -> np.ndarray:
    """Seconds on the wall, and of all processors."""
    return np.array([time.perf_counter(), time.process_time()])


class System:
    """Stiffness of the free dofs, and which of them are on the surface."""

    def __init__(self, body: Body):
        stiffness = body.stiffness()
        self.free = np.setdiff1d(np.arange(stiffness.shape[0]), body.fixed_dofs)
        self.matrix = stiffness[self.free][:, self.free].tocsc()
        surface = (3 * body.mesh.surface_nodes[:, None] + np.arange(3)).ravel()
        self.columns = np.searchsorted(self.free, np.intersect1d(surface, self.free))

    def blocks(self, columns: np.ndarray, width: int) -> Iterable[np.ndarray]:
        """Right-hand sides of some columns, ``width`` at a time, Fortran order."""
        for first in range(0, len(columns), width):
            block = columns[first : first + width]
            right = np.zeros((len(self.free), len(block)), order="F")
            right[block, np.arange(len(block))] = 1.0
            yield right

    def scaled(self, factor_seconds: np.ndarray, column_seconds: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Time of all columns from that of some."""
        return factor_seconds + column_seconds * len(self.columns) / len(columns)


def palpate_columns(body: Body) -> tuple[np.ndarray, np.ndarray]:
    """Seconds for the operator in memory, and for writing, verifying and reading its file."""
    started = now()
    core = _native.GreenCore.precompute(problem_arrays(body, None), "f32", "{}", None)
    computed = now()
    with tempfile.TemporaryDirectory(prefix="palpate-bench-") as folder:
        core.save(Path(folder) / "a.palpate")
        GreensFunction.load(Path(folder) / "a.palpate")
        return computed - started, now() - computed


def dense_inverse(system: System, columns: np.ndarray) -> np.ndarray:
    """Time LAPACK's inverse of the whole matrix: the paper's method."""
    started = now()
    np.linalg.inv(system.matrix.toarray())[np.ix_(columns, columns)]
    return now() - started


def time_solver(
    system: System, columns: np.ndarray, factorise: Callable[[], Callable[[np.ndarray], np.ndarray]], width: int
) -> np.ndarray:
    """Time a factorisation, and its solutions for so many right-hand sides at a time, scaled to all columns."""
    started = now()
    solve = factorise()
    factored = now()
    for right in system.blocks(columns, width):
        solve(right)[system.columns]
    return system.scaled(factored - started, now() - factored, columns)


def superlu(system: System, columns: np.ndarray) -> np.ndarray:
    """Time SciPy's splu in its mode for symmetric matrices."""
    from scipy.sparse.linalg import splu

    options = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
    return time_solver(system, columns, lambda: splu(system.matrix, **options).solve, 64)


def cholmod(system: System, columns: np.ndarray) -> np.ndarray:
    """Time CHOLMOD, supernodal and ordered by METIS; 64 right-hand sides at a time were best."""
    from sksparse.cholmod import cholesky

    return time_solver(system, columns, lambda: cholesky(system.matrix, mode="supernodal", ordering_method="metis"), 64)


def pardiso(system: System, columns: np.ndarray) -> np.ndarray:
    """Time MKL PARDISO, Cholesky of the upper triangle; 128 right-hand sides at a time were best."""
    import scipy.sparse
    from pypardiso import PyPardisoSolver

    solver = PyPardisoSolver(mtype=2)
    upper = scipy.sparse.triu(system.matrix, format="csr")
    upper.sort_indices()

    def factorise() -> Callable[[np.ndarray], np.ndarray]:
        solver.factorize(upper)
        return lambda right: solver.solve(upper, right)

    took = time_solver(system, columns, factorise, 128)
    solver.free_memory(everything=True)
    return took


PEERS: dict[str, Callable[[System, np.ndarray], np.ndarray]] = {
    "SuperLU": superlu,
    "CHOLMOD": cholmod,
    "MKL PARDISO": pardiso,
}
# What a peer needs beyond Palpate's own dependencies.
PACKAGES = {"CHOLMOD": ("sksparse", "scikit-sparse"), "MKL PARDISO": ("pypardiso", "pypardiso")}


def missing_peers() -> dict[str, str]:
    """Peers that are not installed, and their packages."""
    return {peer: name for peer, (module, name) in PACKAGES.items() if importlib.util.find_spec(module) is None}


def plot(results: Sequence[Result], file: Path) -> None:
    """Time against surface dofs, one curve a method and number of threads; of one thread the processor's time."""
    figure = empty_figure(7, 5)
    axes = figure.subplots()
    names = list(dict.fromkeys(result.method for result in results))
    for threads, style in zip(sorted({result.threads for result in results}), ("o-", "s--", "^:"), strict=False):
        for number, name in enumerate(names):
            rows = [r for r in results if (r.method, r.threads) == (name, threads)]
            curve = sorted((r.surface_dofs, r.cpu_seconds if threads == 1 else r.seconds) for r in rows)
            label = f"{name}, {threads} thread{'s' * (threads > 1)}"
            axes.loglog(*zip(*curve, strict=True), style, color=f"C{number}", label=label)
    axes.set_xlabel("surface dofs")
    axes.set_ylabel("all surface columns, factorisation included, s")
    axes.legend(fontsize=8)
    write_figure(figure, file)


def as_tables(results: Sequence[Result]) -> list[Table]:
    """Return a table a body and number of threads; shares are Palpate's time over that of the row."""
    tables = []
    for size, threads in dict.fromkeys((r.size, r.threads) for r in results):
        rows = [r for r in results if (r.size, r.threads) == (size, threads)]
        ours = next(r for r in rows if r.method == "Palpate")
        lines = []
        for r in rows:
            wall = (f"{r.seconds:.4g}", f"{ours.seconds / r.seconds:.3f}")
            cpu = (f"{r.cpu_seconds:.4g}", f"{ours.cpu_seconds / r.cpu_seconds:.3f}")
            columns = "all" if r.sampled is None else f"{r.sampled} scaled"
            lines.append([r.method, *wall, *cpu, columns, str(r.repeats)])
        title = f"{ours.nodes} nodes, {ours.surface_dofs} surface dofs, {threads} thread{'s' * (threads > 1)}"
        headings = ["all surface columns by", "s", "share", "CPU s", "share", "columns", "runs"]
        note = f"Palpate's file, written, verified and read: {ours.writing_seconds or 0.0:.3g} s more"
        tables.append(Table(title, headings, lines, notes=[note]))
    return tables


def precompute(
    sizes: Annotated[str, typer.Option(help="Bodies, of about 1k, 2k, 15k and 20k nodes.")] = "1k,2k,20k",
    threads: Annotated[str, typer.Option(help="Numbers of threads.")] = "1,2",
    out: Out = None,
    as_json: Json = False,
) -> None:
    """All surface columns of a liver, beside other solvers in the same run.

    Peers: pip install 'palpate[bench]'. With --out time is drawn against surface dofs into precompute.png.

    Example: python -m benches precompute --sizes 1k,2k --out plots
    """
    with status_line("measuring; the larger bodies take minutes"):
        results = run(sizes.split(","), [int(count) for count in threads.split(",")])
    if folder := make_folder(out):
        plot(results, folder / "precompute.png")
    left_out = [f"{peer} was left out: pip install {package}" for peer, package in missing_peers().items()]
    tables = as_tables(results)
    tables[-1] = replace(tables[-1], notes=[*tables[-1].notes, "share: Palpate's time over that of the row", *left_out])
    show(as_json, results, *tables)


if __name__ == "__main__":
    _native.end_with_parent(watch_input=False)
    print(json.dumps([asdict(result) for result in measure(sys.argv[1], int(sys.argv[2]))]))
