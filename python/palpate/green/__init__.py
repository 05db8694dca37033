"""Green's functions: planning a precomputation, running it, and solving with the result."""

from palpate.green.answer import Answer, Touch
from palpate.green.background import BackgroundPrecompute
from palpate.green.bounds import error_text
from palpate.green.function import GreensFunction, require_precise
from palpate.green.plan import Plan, plan
from palpate.green.precompute import precompute
