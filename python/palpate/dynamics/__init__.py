"""Motion: eigenmodes, damping, Newmark's scheme by modes and on all dofs."""

from palpate.dynamics.basis import ModalBasis, modes
from palpate.dynamics.newmark import Energy, Newmark, rayleigh_from_ratios
