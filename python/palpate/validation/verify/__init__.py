"""Accuracy that anyone can repeat: figures beside closed forms and published values, by the calls a user has."""

from palpate.validation.verify.benchmark import Benchmark, Check, Outcome
from palpate.validation.verify.table import BENCHMARKS, chosen
