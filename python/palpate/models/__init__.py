"""Ready-made soft bodies: the paper's doll, kidney, liver and beam.

Each comes in two versions: in 10-node tetrahedra whose faces follow the shape, and in 4-node ones with the paper's
numbers of nodes and elements (``paper=True``). They are the project's own shapes, as large as real ones, made by
``scripts/make_models.py`` and shipped as data. Axes: x to the body's left, y to its back, z up, lowest point at z = 0;
the beam lies along x, clamped end at x = 0.
"""

from palpate.models.catalogue import NAMES, PAPER, PaperModel, beam, doll, fixed, kidney, liver, load

__all__ = ["NAMES", "PAPER", "PaperModel", "beam", "doll", "fixed", "kidney", "liver", "load"]
