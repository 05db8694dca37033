"""Texts of the warnings of a simulation."""

from __future__ import annotations

from collections.abc import Iterable

from palpate.scene import BuiltBody


def error_text(error: float) -> str:
    """Warning of the largest estimated relative error of a force."""
    return (
        f"the force of a contact may be off by {100 * error:.2g} % (`error` of the contacts): press less deep, or "
        "make the elements smaller"
    )


def limit_text(what: str, bodies: Iterable[BuiltBody], strain_limit: float) -> str:
    """Warning of a tool, which ``what`` names, that was held."""
    if any(body.is_hyperelastic for body in bodies):
        return (
            f"{what} was held where the law of its material ends, so the force stays as it was at that depth: "
            "press less deep"
        )
    return (
        f"{what} was held at the strain limit of {100 * strain_limit:.0f} % (view.strain_limit): its "
        f"force stays as it was at that depth; press less deep"
    )


def refused_text(tick: int, reason: str) -> str:
    """Warning of a tool that was in a body without a force."""
    return f"a tool reached a body without a force, first in tick {tick}: {reason}"
