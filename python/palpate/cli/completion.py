"""Words that the shell completes."""

from __future__ import annotations

from collections.abc import Iterable

from palpate.models import NAMES
from palpate.scene.devices import KINDS
from palpate.sessions import FORMATS
from palpate.units import LENGTH_UNITS


def units(incomplete: str) -> list[str]:
    """Units of length."""
    return _completions(LENGTH_UNITS, incomplete)


def models(incomplete: str) -> list[str]:
    """Built-in models."""
    return _completions(NAMES, incomplete)


def precisions(incomplete: str) -> list[str]:
    """List the number formats of a store."""
    return _completions(("f16", "f32", "f64"), incomplete)


def formats(incomplete: str) -> list[tuple[str, str]]:
    """List the formats that a recording is written in, and what they are."""
    return [(ending[1:], what) for ending, what in FORMATS.items() if ending[1:].startswith(incomplete)]


def checks(incomplete: str) -> list[tuple[str, str]]:
    """Benchmarks with a known answer, and what they are."""
    from palpate.validation.verify import BENCHMARKS

    return [(name, known.title) for name, known in BENCHMARKS.items() if name.startswith(incomplete)]


def devices(incomplete: str) -> list[str]:
    """Kinds of devices."""
    return _completions(KINDS, incomplete)


def _completions(words: Iterable[str], incomplete: str) -> list[str]:
    return [word for word in words if word.startswith(incomplete)]
