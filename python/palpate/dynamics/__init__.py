"""Motion: eigenmodes, damping, Newmark's scheme by modes and on all dofs."""

from palpate.dynamics.basis import ModalBasis, modes
from palpate.dynamics.damping import rayleigh_from_ratios
from palpate.dynamics.energy import Energy
from palpate.dynamics.newmark import Newmark

__all__ = ["Energy", "ModalBasis", "Newmark", "modes", "rayleigh_from_ratios"]
