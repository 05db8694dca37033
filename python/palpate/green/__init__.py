"""Green's functions: what a precomputation will need, the precomputation, and the answers."""

from palpate.green.answer import Answer, Touch
from palpate.green.function import GreensFunction
from palpate.green.plan import Plan, plan
from palpate.green.precompute import precompute

__all__ = ["Answer", "GreensFunction", "Plan", "Touch", "plan", "precompute"]
