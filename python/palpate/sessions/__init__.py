"""Recordings: exported to other formats, compared, rerun in another scene."""

from palpate.sessions.compare import Comparison, QuantityDifference, compare
from palpate.sessions.export import FORMATS, export
from palpate.sessions.rerun import rerun
