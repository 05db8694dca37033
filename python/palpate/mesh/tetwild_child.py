"""The repairing mesher's own process: ``python -m palpate.mesh.tetwild_child SURFACE.npz MESH.npz``.

fTetWild fills what an open, crossing or doubled surface most plausibly encloses, within an envelope around it.

Exit status 1: no tetrahedra; 3: pytetwild is not installed.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np

from palpate._native import end_with_parent


def main(given: str, made: str) -> int:
    """Mesh the triangles of ``given`` into ``made``."""
    try:
        from pytetwild import tetrahedralize
    except ImportError:
        return 3
    with np.load(given) as job:
        vertices, faces, size = job["vertices"], job["faces"].astype(np.int32), float(job["size"])
    # fTetWild leaves a surface of its own in the working directory.
    os.chdir(Path(made).parent)
    nodes, tets = tetrahedralize(vertices, faces, edge_length_abs=size)
    if len(tets) == 0:
        return 1
    used = np.unique(tets)
    np.savez(made, nodes=nodes[used], tets=np.searchsorted(used, tets))
    return 0


if __name__ == "__main__":
    end_with_parent()
    sys.exit(main(*sys.argv[1:3]))
