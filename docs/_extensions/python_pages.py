"""The page of the public Python names; a name without a documentation is an error."""

from __future__ import annotations

import inspect

import palpate
from palpate import models, palpation, shapes

HEAD = """# Python

Every public name of `palpate`. Quantities are in SI units, arrays are C-ordered, nodes are numbered from 0. This page
is generated from the docstrings.
"""

# Chapters of the page; names that stand in none of them are an error.
CHAPTERS = {
    "Meshes": ("TetMesh", "tetrahedralize"),
    "Bodies": ("Material", "Loads", "Body"),
    "Answers computed beforehand": ("plan", "Plan", "precompute", "GreensFunction", "Touch", "Answer"),
    "Strain and stress": ("SurfaceStress", "StressRecovery"),
    "Bodies in motion": ("modes", "ModalBasis", "rayleigh_from_ratios", "Newmark", "Energy"),
    "Scenes and the force loop": ("Scene", "Simulation", "Frame", "Contact", "pack"),
    "Contact as a sensor": ("Sensor", "SensorContacts"),
    "Fit to measurements": ("fit", "Fit", "FittedParameter", "Indentations"),
    "Notebooks": ("widget",),
    "Devices": ("Device", "DeviceLimits", "Reading"),
    "Recordings": (
        *("Recording", "RecordingStatus", "replay", "Replayed", "Difference", "rerun", "compare", "Comparison"),
        *("QuantityDifference", "export"),
    ),
}
MODULES = {"shapes": shapes, "models": models, "palpation": palpation}
EXCEPTIONS = "Errors and warnings"


def page() -> str:
    """Write the page."""
    exceptions = [name for name in palpate.__all__ if is_exception(getattr(palpate, name))]
    placed = {name for names in CHAPTERS.values() for name in names} | set(exceptions) | set(MODULES)
    missing = sorted(set(palpate.__all__) - placed)
    if missing:
        raise SystemExit(f"docs: python_pages.py has no chapter for {', '.join(missing)}")
    chapters: dict[str, list[str]] = {title: [f"palpate.{name}" for name in names] for title, names in CHAPTERS.items()}
    for name, module in MODULES.items():
        # An exception that a module offers too is described once.
        own = (part for part in public_names(module) if part not in exceptions)
        chapters[f"palpate.{name}"] = [f"palpate.{name}.{part}" for part in own]
    chapters[EXCEPTIONS] = [f"palpate.{name}" for name in exceptions]
    return "\n".join([HEAD, *(chapter(title, names) for title, names in chapters.items())])


def public_names(module: object) -> list[str]:
    """Names of a module that are documented: classes and functions."""
    listed = getattr(module, "__all__", None) or [n for n in vars(module) if not n.startswith("_")]
    return [
        name
        for name in listed
        if (inspect.isclass(getattr(module, name)) or inspect.isfunction(getattr(module, name)))
        and getattr(module, name).__module__.startswith("palpate")
    ]


def chapter(title: str, names: list[str]) -> str:
    """Write one chapter."""
    return f"## {title}\n\n" + "\n".join(directive(name) for name in names)


def directive(name: str) -> str:
    """Have Sphinx document one name; what has no docstring is an error."""
    thing = found(name)
    if not inspect.getdoc(thing):
        raise SystemExit(f"docs: {name} has no docstring")
    if inspect.isclass(thing):
        for member, value in members(thing):
            if not inspect.getdoc(getattr(value, "__func__", value)):
                raise SystemExit(f"docs: {name}.{member} has no docstring")
    kind = "autoexception" if is_exception(thing) else "autoclass" if inspect.isclass(thing) else "autofunction"
    options = ["   :members:", "   :inherited-members: object, BaseModel, Exception"] if kind == "autoclass" else []
    return "\n".join(["```{eval-rst}", f".. {kind}:: {name}", *options, "```", ""])


def found(name: str) -> object:
    """Object of a dotted name."""
    thing: object = palpate
    for part in name.split(".")[1:]:
        thing = getattr(thing, part)
    return thing


def members(cls: type) -> list[tuple[str, object]]:
    """Public methods and properties that the package itself gives a class."""
    own = [base for base in cls.__mro__ if base.__module__.startswith("palpate")]
    return [
        (name, value)
        for base in own
        for name, value in vars(base).items()
        if not name.startswith("_")
        and (inspect.isfunction(value) or isinstance(value, (classmethod, staticmethod, property)))
    ]


def is_exception(thing: object) -> bool:
    """Whether a name is an error or a warning."""
    return inspect.isclass(thing) and issubclass(thing, BaseException)
