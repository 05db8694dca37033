"""All benchmarks by name, in the order of the table."""

from __future__ import annotations

from collections.abc import Sequence

from palpate.errors import Error
from palpate.validation.verify import exactness, felt, half_space, palpation, statics, surface, vibration
from palpate.validation.verify.benchmark import Benchmark
from palpate.validation.verify.contact import energy, groove, large_strain, pressing, sliding

BENCHMARKS = {
    benchmark.name: benchmark
    for benchmark in (
        Benchmark("patch", "Patch test, irregular elements", exactness.patch_test),
        Benchmark("rigid", "Rigid motions", exactness.rigid_motions),
        Benchmark("convergence", "Orders of convergence, smooth displacement", exactness.convergence, slow=True),
        Benchmark("surface", "All of a surface in stages, 5k tetrahedra", surface.full_surface),
        Benchmark("cantilever", "Cantilever, length 10 depths", statics.cantilever),
        Benchmark("cook", "Cook's membrane, plane strain", statics.cook),
        Benchmark("le10", "NAFEMS LE10, thick elliptic plate", statics.thick_plate),
        Benchmark("sphere", "Thick sphere under internal pressure, 10 nodes", statics.thick_sphere),
        Benchmark("point", "Point force on a half-space, 10 nodes", half_space.point_force),
        Benchmark("disc", "Uniform pressure on a half-space, 10 nodes", half_space.pressed_disc),
        Benchmark("punch", "Rigid flat punch without friction, 10 nodes", half_space.flat_punch),
        Benchmark(
            "clamped", "Frequencies of a beam, clamped and free, length 10 depths, 10 nodes", vibration.clamped_beam
        ),
        Benchmark("free", "Frequencies of a free beam, length 10 depths, 10 nodes", vibration.free_beam),
        Benchmark("fv52", "NAFEMS FV52, plate on hard simple supports, 10 nodes", vibration.plate, slow=True),
        Benchmark("felt", "Stiffness felt on a block", felt.felt_stiffness, slow=True),
        Benchmark("hertz", "A sphere in the tick, R = 10 mm, on a block of 10 kPa", pressing.hertz, slow=True),
        Benchmark("strain", "A sphere pressed deep, neo-Hookean, E = 10 kPa", large_strain.large_strain, slow=True),
        Benchmark("shapes", "An ellipsoid and a rounded punch in the tick", pressing.shapes, slow=True),
        Benchmark("beside", "A sphere beside an edge, and beside another", pressing.edges_and_neighbours, slow=True),
        Benchmark("groove", "A sphere in a groove: two places at once", groove.groove, slow=True),
        Benchmark("slide", "Sliding without friction at constant depth", sliding.ripple, slow=True),
        Benchmark("sweep", "Sweeps by the micrometre", sliding.jumps, slow=True),
        Benchmark("friction", "Coulomb's cone, Mindlin's partial slip", sliding.friction, slow=True),
        Benchmark("energy", "Work given out over random closed paths", energy.closed_paths, slow=True),
        Benchmark("balance", "All forces on a body, tick by tick", energy.balance),
        Benchmark("palpation", "A stiffness map over a nodule, E = 5 and 40 kPa", palpation.palpation, slow=True),
    )
}


def chosen(names: Sequence[str]) -> list[Benchmark]:
    """Benchmarks by name, all for no name; Error for a name that no benchmark has."""
    for name in names:
        if name not in BENCHMARKS:
            raise Error(f"no benchmark is called '{name}'; there are {', '.join(BENCHMARKS)}")
    return [BENCHMARKS[name] for name in names or BENCHMARKS]
